// Which kinematics ties each slave, and which rotational freedoms the model keeps.
#include <algorithm>

#include "compilation.hpp"

namespace tiefmu {

namespace {

constexpr double conditionWarned = 1e6;    // of Ibar
constexpr double offsetNegligible = 1e-9;  // of the segment's size
constexpr double addedMassWarned = 0.1;    // of the masters' own

// What the lumped inertia of a mean-motion tie adds to its free masters beyond the slaves' own mass (theory 4):
// (J + m d^2) lambda on each.
struct AddedMass {
  double sum = 0, largest = 0;  // kg
  const Bond* bond = nullptr;   // of the largest
  std::vector<int> masters;     // free ones, repeated

  void add(const Scene& scene, const Bond& b, double lambda) {
    const double each = (scene.nodes.inertia[b.slave] + scene.nodes.mass[b.slave] * b.offset.squaredNorm()) * lambda;
    double all = 0;
    for (int i = 0; i < b.corners; ++i) {
      const int node = scene.segments.nodes[b.segment][i];
      if (scene.nodes.motion[node] != Motion::free) continue;
      masters.push_back(node);
      all += each;
    }
    sum += all;
    if (all > largest) {
      largest = all;
      bond = &b;
    }
  }
  double ownMass(const Scene& scene) {
    std::sort(masters.begin(), masters.end());
    masters.erase(std::unique(masters.begin(), masters.end()), masters.end());
    double mass = 0;
    for (int node : masters) mass += scene.nodes.mass[node];
    return mass;
  }
};

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
  std::vector<AddedMass> added(scene.ties.size());
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
      added[b.tie].add(scene, b, inertia.lambda);
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
      warn(tie(s.bond->tie) + "slave " + id(s.bond->slave) + ": offset d = " + length(s.largest) + " from segment " +
           segmentId(s.bond->segment) + ", whose nodes have no rotations" +
           (s.count > 1 ? " (the largest of " + std::to_string(s.count) + " such slaves)" : "") +
           ": the offset never turns and the moment d x F is lost; formulation = \"optimized\" carries both");
  if (scene.settings.inertia != Inertia::lumped) return;
  for (AddedMass& a : added) {
    const double own = a.ownMass(scene);
    if (!a.bond || !(a.sum > addedMassWarned * own)) continue;
    const Bond& b = *a.bond;
    warn(tie(b.tie) + "adds " + mass(a.sum) + " to free masters of " + mass(own) + ", most of it from slave " +
         id(b.slave) + " of " + mass(scene.nodes.mass[b.slave]) + " at an offset of " + length(b.offset.norm()) +
         " from the centre of segment " + segmentId(b.segment) + " (" + mass(a.largest) +
         "); inertia = \"consistent\" adds none, a nearer or larger segment less");
  }
}

// The rotational freedoms that the model keeps: those of free nodes that nothing turns and nothing resists are left
// out (a zero inertia could not be integrated).
void Compilation::resolveRotations() {
  turns = scene.nodes.rotations;
  std::vector<std::uint8_t> used(turns.size(), 0);
  for (const Bond& b : bonds)
    if (kinematicsOf(b.coupling).mastersTurn)
      for (int i = 0; i < b.corners; ++i) used[scene.segments.nodes[b.segment][i]] = 1;
  for (const SceneSpring& s : scene.springs)
    if (s.kind != SpringKind::axial) {
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
