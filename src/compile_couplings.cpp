// Which kinematics ties each slave, and which rotational freedoms the model keeps.
#include "compilation.hpp"

namespace tiefmu {

namespace {

constexpr double conditionWarned = 1e6;    // of Ibar
constexpr double offsetNegligible = 1e-9;  // of the segment's size

}  // namespace

void Compilation::chooseCouplings() {
  bound.assign(scene.nodes.id.size(), 0);
  master.assign(scene.nodes.id.size(), 0);
  struct StillOffsets {
    int count = 0;
    double largest = 0;
    const Bond* bond = nullptr;
  };
  std::vector<StillOffsets> stillOffsets(scene.ties.size());
  std::vector<std::uint8_t> toldCondition(scene.segments.id.size(), 0), toldRotations = toldCondition;
  for (Bond& b : bonds) {
    bound[b.slave] = 1;
    const auto& nodes = scene.segments.nodes[b.segment];
    std::string turning, still;
    for (int i = 0; i < b.corners; ++i) {
      master[nodes[i]] = 1;
      std::string& list = scene.nodes.rotations[nodes[i]] ? turning : still;
      list += (list.empty() ? "" : ", ") + id(nodes[i]);
    }
    const std::string where = tie(b.tie) + "slave " + id(b.slave) + ": ";
    const std::string onSegment = tie(b.tie) + "segment " + segmentId(b.segment) + ": ";
    Vec3 x[4];
    const NodeInertia inertia = nodeInertia(gather(b.segment, x), x);
    if (scene.ties[b.tie].formulation == Formulation::optimized) {
      b.coupling = Coupling::meanMotion;
      b.offset = scene.nodes.position[b.slave] - inertia.centre;
      if (!(inertia.condition <= conditionRefused))
        throw SceneError(onSegment + "cannot hold slave " + id(b.slave) + ": its nodes are collinear (cond(Ibar) = " +
                         text(inertia.condition) + ", at most 1e12), which leaves the rotation about them open");
      if (inertia.condition > conditionWarned && !toldCondition[b.segment]) {
        toldCondition[b.segment] = 1;
        warn(onSegment + "its nodes are nearly collinear: cond(Ibar) = " + text(inertia.condition));
      }
      continue;
    }
    b.coupling = still.empty() ? Coupling::rotation : Coupling::translation;
    if (b.coupling == Coupling::rotation) continue;
    if (!turning.empty() && !toldRotations[b.segment]) {
      toldRotations[b.segment] = 1;
      warn(onSegment + "counts as without rotations: nodes " + turning + " have them, nodes " + still + " do not");
    }
    const double size = (x[2] - x[0]).norm(), d = b.offset.norm();
    if (d > offsetNegligible * size) {
      StillOffsets& still1 = stillOffsets[b.tie];
      if (still1.count++ == 0 || d > still1.largest) {
        still1.largest = d;
        still1.bond = &b;
      }
    }
    if (scene.nodes.inertia[b.slave] > 0)
      throw SceneError(where + "has rotary inertia, but the nodes of segment " + segmentId(b.segment) +
                       " have no rotations to carry it; use formulation = \"optimized\" or rotations = true");
  }
  for (const StillOffsets& s : stillOffsets)
    if (s.count > 0)
      warn(tie(s.bond->tie) + "slave " + id(s.bond->slave) + ": offset d = " + text(s.largest) + " m from segment " +
           segmentId(s.bond->segment) + ", whose nodes have no rotations" +
           (s.count > 1 ? " (the largest of " + std::to_string(s.count) + " such slaves)" : "") +
           ": the offset never turns and the moment d x F is lost; formulation = \"optimized\" carries both");
}

// The rotational freedoms that the model keeps: those of free nodes that nothing turns and nothing resists are left
// out (a zero inertia could not be integrated).
void Compilation::resolveRotations() {
  turns = scene.nodes.rotations;
  std::vector<std::uint8_t> used(turns.size(), 0);
  for (const Bond& b : bonds)
    if (b.coupling == Coupling::rotation)
      for (int i = 0; i < b.corners; ++i) used[scene.segments.nodes[b.segment][i]] = 1;
  for (const SceneSpring& s : scene.springs)
    if (s.kind == SpringKind::bushing) {
      used[s.a] = 1;
      if (s.b >= 0) used[s.b] = 1;
    }
  std::string left;
  for (int node = 0; node < static_cast<int>(turns.size()); ++node)
    if (master[node] && turns[node] && !used[node] && scene.nodes.motion[node] == Motion::free &&
        scene.nodes.inertia[node] == 0) {
      turns[node] = 0;
      left += (left.empty() ? "" : ", ") + id(node);
    }
  if (!left.empty())
    note("rotations of nodes " + left + " left out: no tie or spring uses them and they have no inertia");
}

}  // namespace tiefmu
