#include "model.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cstdio>
#include <numeric>
#include <tuple>

#include "ordering.hpp"
#include "port.hpp"
#include "search.hpp"

namespace tiefmu {
namespace {

constexpr double conditionRefused = 1e12, conditionWarned = 1e6;
constexpr double offsetNegligible = 1e-9;  // of the segment's size

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.6g", value);
  return buffer;
}

// One slave bound to its segment.
struct Bond {
  int slave, tie, segment;  // scene indices
  int corners;
  Coupling coupling;
  Projection projection;
  Vec3 offset;
};

class Compiler {
 public:
  explicit Compiler(const Scene& s) : scene(s) {}

  Model run() {
    model.settings = scene.settings;
    if (scene.settings.inertia == Inertia::lumped && scene.settings.reaction == Reaction::split)
      throw SceneError("model: reaction: 'split' needs inertia = 'consistent' (with lumped inertia it equals 'loads')");
    if (!scene.ports.empty() && scene.settings.position == Position::input)
      throw SceneError("interface: ports: need position = 'integrated' in [model]: a port's nodes move with the port");
    if (scene.settings.safety > 1)
      warn("integrator: safety = " + text(scene.settings.safety) +
           " lets steps be longer than the stability limit: expect the solution to diverge");
    claimSlaves();
    for (int t = 0; t < static_cast<int>(scene.ties.size()); ++t) bind(t);
    chooseCouplings();
    resolveRotations();
    placeNodes();
    placeSlaves();
    placeSprings();
    for (const bool ofSlaves : {false, true})
      for (int k = 0; k < static_cast<int>(scene.ports.size()); ++k) placePort(k, ofSlaves);
    adviseOnInertia();
    return std::move(model);
  }

 private:
  const Scene& scene;
  Model model;
  std::vector<int> tieOf;  // per scene node: the tie it is a slave of, or -1
  std::vector<Bond> bonds;
  std::vector<std::uint8_t> bound;         // per scene node: is a slave of the model
  std::vector<std::uint8_t> master;        // per scene node
  std::vector<std::uint8_t> turns;         // per scene node: rotational freedom that the model keeps
  std::vector<int> nodeIndex, slaveIndex;  // per scene node: index in the model, or -1
  std::vector<int> segmentRotation;        // per slave of the model: index of its meanMotion segment, or -1
  std::vector<std::vector<int>> partEnds;  // per group
  std::vector<int> orientationOfSlave, orientationOfNode;  // per slave and node of the model: quaternion, or -1
  int meanMotionSegments = 0;

  void warn(std::string line) { model.findings.push_back({Finding::warning, std::move(line)}); }
  void note(std::string line) { model.findings.push_back({Finding::note, std::move(line)}); }
  std::string id(int node) const { return std::to_string(scene.nodes.id[node]); }
  std::string segmentId(int e) const { return std::to_string(scene.segments.id[e]); }
  std::string tie(int t) const { return "tie '" + scene.ties[t].name + "': "; }
  int corners(int e) const { return scene.segments.nodes[e][3] < 0 ? 3 : 4; }
  int gather(int e, Vec3* x) const {
    const int n = corners(e);
    for (int i = 0; i < n; ++i) x[i] = scene.nodes.position[scene.segments.nodes[e][i]];
    return n;
  }

  // No slave in two ties, none that is also a master.
  void claimSlaves() {
    tieOf.assign(scene.nodes.id.size(), -1);
    for (int t = 0; t < static_cast<int>(scene.ties.size()); ++t)
      for (int s : scene.ties[t].slaves) {
        if (tieOf[s] >= 0)
          throw SceneError(tie(t) + "slave " + id(s) + ": is already a slave of tie '" + scene.ties[tieOf[s]].name +
                           "'; a node can follow one tie only");
        tieOf[s] = t;
      }
    for (int t = 0; t < static_cast<int>(scene.ties.size()); ++t)
      for (int e : scene.ties[t].segments)
        for (int i = 0; i < corners(e); ++i) {
          const int node = scene.segments.nodes[e][i];
          if (tieOf[node] >= 0)
            throw SceneError(tie(tieOf[node]) + "slave " + id(node) + ": is also a master, on segment " + segmentId(e) +
                             " of tie '" + scene.ties[t].name + "'; take it out of one of them");
        }
  }

  void bind(int t) {
    const SceneTie& spec = scene.ties[t];
    std::vector<std::array<int, 4>> nodes;
    std::vector<std::int64_t> ids;
    for (int e : spec.segments) {
      nodes.push_back(scene.segments.nodes[e]);
      ids.push_back(scene.segments.id[e]);
    }
    const SegmentSearch search(scene.nodes.position, std::move(nodes), std::move(ids));
    std::string passedOver;
    for (int k : search.zeroArea()) {
      warn(tie(t) + "segment " + segmentId(spec.segments[k]) +
           ": has no area (its nodes coincide, are collinear or fold onto each other); passed over");
      passedOver += (passedOver.empty() ? "" : ", ") + segmentId(spec.segments[k]);
    }
    const double distance = spec.searchDistance > 0 ? spec.searchDistance : search.defaultDistance();
    model.searchDistance.push_back(distance);
    for (int s : spec.slaves) {
      const Vec3& x = scene.nodes.position[s];
      const Match match = spec.search == SearchMethod::box ? search.box(x, distance) : search.nearestNode(x, distance);
      if (match.segment < 0) {
        unresolved(t, s, match, distance, search, passedOver);
        continue;
      }
      const int e = spec.segments[match.segment];
      const std::string where = tie(t) + "slave " + id(s) + ": ";
      if (match.projection.outside > SegmentSearch::warnOutside)
        warn(where + "lies outside segment " + segmentId(e) + " (xi = " + text(match.projection.xi) +
             ", eta = " + text(match.projection.eta) + "); its inertia uses the projection clamped to the segment");
      if (match.unconverged >= 0)
        warn(where + "the projection on segment " + segmentId(spec.segments[match.unconverged]) +
             " did not converge; the segment was passed over");
      bonds.push_back({s, t, e, corners(e), Coupling::translation, match.projection, x - match.projection.point});
    }
  }

  void unresolved(int t, int s, const Match& match, double distance, const SegmentSearch& search,
                  const std::string& passedOver) {
    const bool box = scene.ties[t].search == SearchMethod::box;
    // Far away: how far tells the user what to change.
    const Match far = search.box(scene.nodes.position[s], 1e6 * distance);
    std::string line = tie(t) + "slave " + id(s) + ": no segment found ";
    line += box ? "within search_distance " + text(distance) + " m"
                : "at its nearest master node in the box of side search_distance " + text(distance) + " m";
    if (far.segment >= 0)
      line += "; the nearest is segment " + segmentId(scene.ties[t].segments[far.segment]) + " at " +
              text(far.distance) + " m";
    else
      line += "; it lies outside every segment by more than half its size";
    if (!passedOver.empty()) line += "; without area and passed over: segment " + passedOver;
    if (match.unconverged >= 0)
      line +=
          "; the projection on segment " + segmentId(scene.ties[t].segments[match.unconverged]) + " did not converge";
    if (!scene.ties[t].dropUnresolved) throw SceneError(line);
    warn(line + "; dropped");
    model.dropped.push_back({scene.nodes.id[s], t, line.substr(line.find("no segment"))});
  }

  void chooseCouplings() {
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
  void resolveRotations() {
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

  void placeNodes() {
    const SceneNodes& all = scene.nodes;
    std::vector<std::uint8_t> point(all.id.size(), 0);
    for (const SceneSpring& s : scene.springs)
      for (int end : {s.a, s.b})
        if (end >= 0 && !bound[end] && !master[end]) point[end] = 1;
    std::vector<int> used;
    for (int node = 0; node < static_cast<int>(all.id.size()); ++node) {
      if (master[node] || point[node])
        used.push_back(node);
      else if (!bound[node])
        model.leftOut.push_back(all.id[node]);
    }
    std::sort(model.leftOut.begin(), model.leftOut.end());
    std::sort(used.begin(), used.end(), [&](int a, int b) { return all.id[a] < all.id[b]; });
    std::vector<int> number(all.id.size()), group(all.id.size());
    int masters = 0, points = 0;
    for (int node : used) {
      number[node] = master[node] ? ++masters : ++points;
      static constexpr int turning[] = {rotatingDrivenMaster, rotatingFreeMaster, rotatingFixedMaster};
      static constexpr int still[] = {drivenMaster, freeMaster, fixedMaster};
      group[node] = (turns[node] ? turning : still)[static_cast<int>(all.motion[node])] + (master[node] ? 0 : 1);
    }
    std::vector<Vec3> places;
    for (int node : used) places.push_back(all.position[node]);
    std::vector<int> near;
    for (int k : localOrder(places)) near.push_back(used[k]);
    used = std::move(near);
    std::stable_sort(used.begin(), used.end(), [&](int a, int b) { return group[a] < group[b]; });
    nodeIndex.assign(all.id.size(), -1);
    for (int node : used) {
      nodeIndex[node] = static_cast<int>(model.nodeId.size());
      for (int g = group[node] + 1; g <= nodeGroups; ++g) model.begin[g] = nodeIndex[node] + 1;
      model.nodeId.push_back(all.id[node]);
      model.nodeNumber.push_back(number[node]);
      model.nodeMass.push_back(all.mass[node]);
      model.nodeInertia.push_back(turns[node] ? all.inertia[node] : 0);
      model.nodeStiffness.push_back(all.stiffness[node]);
      model.nodeRotationalStiffness.push_back(all.rotationalStiffness[node]);
      const bool still = all.motion[node] == Motion::fixed;
      const Vec3 v = still ? Vec3(0, 0, 0) : all.velocity[node], w = still ? Vec3(0, 0, 0) : all.spin[node];
      model.nodePosition.insert(model.nodePosition.end(), all.position[node].begin(), all.position[node].end());
      model.nodeVelocity.insert(model.nodeVelocity.end(), v.begin(), v.end());
      if (turns[node]) model.nodeSpin.insert(model.nodeSpin.end(), w.begin(), w.end());
    }
  }

  // Bonds by coupling, shape and segment: segments as localOrder and then `split` of each group say.
  void sortBonds() {
    const auto sort = [&](const std::vector<int>& rank) {
      const auto key = [&](int k) {
        const Bond& b = bonds[k];
        return std::tuple(b.coupling, -b.corners, rank[k], b.segment, scene.nodes.id[b.slave]);
      };
      std::vector<int> order(bonds.size());
      std::iota(order.begin(), order.end(), 0);
      std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
      std::vector<Bond> sorted;
      sorted.reserve(bonds.size());
      for (int k : order) sorted.push_back(bonds[k]);
      bonds = std::move(sorted);
    };
    std::vector<Vec3> centres(scene.segments.id.size(), Vec3(0, 0, 0));
    for (int e = 0; e < static_cast<int>(centres.size()); ++e) {
      Vec3 x[4];
      gather(e, x);
      for (int i = 0; i < corners(e); ++i) centres[e] += x[i] / corners(e);
    }
    std::vector<int> rankOf(centres.size()), rank(bonds.size());
    const std::vector<int> order = localOrder(centres);
    for (int k = 0; k < static_cast<int>(order.size()); ++k) rankOf[order[k]] = k;
    for (std::size_t k = 0; k < bonds.size(); ++k) rank[k] = rankOf[bonds[k].segment];
    sort(rank);
    const int count = static_cast<int>(bonds.size());
    for (int first = 0, last = 0; first < count; first = last) {
      std::vector<int> node, segmentOf;  // segmentOf: per bond of the group, counted within it
      for (;
           last < count && bonds[last].coupling == bonds[first].coupling && bonds[last].corners == bonds[first].corners;
           ++last) {
        const Bond& b = bonds[last];
        if (last == first || b.segment != bonds[last - 1].segment)
          for (int i = 0; i < b.corners; ++i) node.push_back(nodeIndex[scene.segments.nodes[b.segment][i]]);
        segmentOf.push_back(static_cast<int>(node.size()) / b.corners - 1);
      }
      const Parts parts = split(node, bonds[first].corners);
      std::vector<int> place(parts.order.size());
      for (int k = 0; k < static_cast<int>(place.size()); ++k) place[parts.order[k]] = k;
      for (int k = first; k < last; ++k) rank[k] = place[segmentOf[k - first]];
      partEnds.push_back(parts.end);
    }
    sort(rank);
  }

  void placeSlaves() {
    sortBonds();
    std::vector<int> byId(bonds.size()), number(bonds.size());
    std::iota(byId.begin(), byId.end(), 0);
    std::sort(byId.begin(), byId.end(),
              [&](int a, int b) { return scene.nodes.id[bonds[a].slave] < scene.nodes.id[bonds[b].slave]; });
    for (int j = 0; j < static_cast<int>(byId.size()); ++j) number[byId[j]] = j + 1;

    const std::size_t count = bonds.size();
    model.slaveOffset.reserve(3 * count);
    for (auto* v : {&model.slaveMass, &model.slaveInertia, &model.slaveStiffness, &model.slaveRotationalStiffness})
      v->reserve(count);
    model.slaveId.reserve(count);
    model.slaveNumber.reserve(count);
    model.slaveReport.reserve(count);
    slaveIndex.assign(scene.nodes.id.size(), -1);
    for (const SceneTie& t : scene.ties) model.tieName.push_back(t.name);
    int lastSegment = -1;
    for (int s = 0; s < static_cast<int>(bonds.size()); ++s) {
      const Bond& b = bonds[s];
      if (model.groups.empty() || model.groups.back().coupling != b.coupling ||
          model.groups.back().corners != b.corners) {
        model.groups.push_back({b.coupling, b.corners, s, {}, {0}, {}, partEnds[model.groups.size()]});
        lastSegment = -1;
      }
      TieGroup& group = model.groups.back();
      if (b.segment != lastSegment) {
        lastSegment = b.segment;
        for (int i = 0; i < b.corners; ++i) group.node.push_back(nodeIndex[scene.segments.nodes[b.segment][i]]);
        group.begin.push_back(group.begin.back());
        if (b.coupling == Coupling::meanMotion) ++meanMotionSegments;
      }
      ++group.begin.back();
      segmentRotation.push_back(b.coupling == Coupling::meanMotion ? meanMotionSegments - 1 : -1);
      group.weight.insert(group.weight.end(), b.projection.phi.begin(), b.projection.phi.begin() + b.corners);

      const int node = b.slave;
      slaveIndex[node] = s;
      if (b.coupling != Coupling::translation) model.turningSlaves = s + 1;
      model.slaveId.push_back(scene.nodes.id[node]);
      model.slaveNumber.push_back(number[s]);
      model.slaveOffset.insert(model.slaveOffset.end(), b.offset.begin(), b.offset.end());
      model.slaveMass.push_back(scene.nodes.mass[node]);
      model.slaveInertia.push_back(scene.nodes.inertia[node]);
      model.slaveStiffness.push_back(scene.nodes.stiffness[node]);
      model.slaveRotationalStiffness.push_back(scene.nodes.rotationalStiffness[node]);

      SlaveReport report;
      report.tie = b.tie;
      report.segment = scene.segments.id[b.segment];
      report.xi = b.projection.xi;
      report.eta = b.projection.eta;
      report.distance = b.projection.distance;
      report.clamped = b.coupling != Coupling::meanMotion && b.projection.outside > 1 + 1e-12;
      model.slaveReport.push_back(report);
    }
    for (auto* v : {&model.slaveStiffness, &model.slaveRotationalStiffness})
      if (std::all_of(v->begin(), v->end(), [](double k) { return k == 0; })) *v = std::vector<double>();
    for (TieGroup& group : model.groups) {
      group.node.shrink_to_fit();
      group.begin.shrink_to_fit();
      group.weight.shrink_to_fit();
    }
  }

  bool canTurn(const SpringEnd& end) const {
    return end.slave >= 0 ? end.slave < model.turningSlaves : end.node >= 0 && end.node < model.rotating();
  }

  // Quaternions are counted through: first those of the meanMotion segments, then those of `oriented`.
  void orient(SpringEnd& end) {
    if (end.slave >= 0 && segmentRotation[end.slave] >= 0) {
      end.orientation = segmentRotation[end.slave];
      return;
    }
    int& index = end.slave >= 0 ? orientationOfSlave[end.slave] : orientationOfNode[end.node];
    if (index < 0) {
      index = meanMotionSegments + static_cast<int>(model.oriented.size());
      end.orientation = index;
      model.oriented.push_back(end);
    }
    end.orientation = index;
  }

  void placeSprings() {
    orientationOfSlave.assign(bonds.size(), -1);
    orientationOfNode.assign(model.nodeId.size(), -1);
    for (const SceneSpring& spec : scene.springs) {
      const std::string where = spec.name + ": ";
      Spring spring{};
      for (const auto& [node, end] : {std::pair{spec.a, &spring.a}, std::pair{spec.b, &spring.b}}) {
        if (node < 0) continue;
        if (bound[node])
          end->slave = slaveIndex[node];
        else
          end->node = nodeIndex[node];
      }
      const bool ground = spec.b < 0;
      if (!ground && spec.a == spec.b) throw SceneError(where + "node " + id(spec.a) + " is joined to itself");
      const Vec3 a = scene.nodes.position[spec.a], b = ground ? a : scene.nodes.position[spec.b];
      spring.kind = spec.kind;
      spring.stiffness = spec.stiffness;
      spring.damping = spec.damping;
      spring.rotationalStiffness = spec.rotationalStiffness;
      spring.rotationalDamping = spec.rotationalDamping;
      spring.arm = a - b;
      spring.anchor = a;
      spring.length = spring.arm.norm();
      if (spec.kind == SpringKind::axial) {
        if (ground)
          throw SceneError(where + "node " + id(spec.a) +
                           ": an axial spring to its own start position has no "
                           "direction; use kind = \"bushing\"");
        if (!(spring.length > 0))
          throw SceneError(where + "nodes " + id(spec.a) + " and " + id(spec.b) +
                           " are at the same place; an axial spring needs two distinct positions");
      } else {
        const bool torsion = !spec.rotationalStiffness.isZero(0) || !spec.rotationalDamping.isZero(0);
        for (const auto& [node, end] : {std::pair{spec.a, &spring.a}, std::pair{spec.b, &spring.b}})
          if (torsion && node >= 0) {
            if (!canTurn(*end)) throw SceneError(where + cannotTurn(node, *end));
            orient(*end);
          }
        if (!ground && spring.length > 0) {
          if (canTurn(spring.b))
            orient(spring.b);
          else if (!fixedNode(spring.b))
            warn(where + (bound[spec.b] ? "slave " : "node ") + id(spec.b) +
                 " cannot turn: the moment of the shear force over the distance " + text(spring.length) +
                 " m is not balanced");
        }
      }
      model.springs.push_back(spring);
    }
  }

  bool fixedNode(const SpringEnd& end) const {
    if (end.node < 0) return false;
    const auto in = [&](int g) { return end.node >= model.begin[g] && end.node < model.begin[g + 1]; };
    return in(rotatingFixedMaster) || in(rotatingFixedPoint) || in(fixedMaster) || in(fixedPoint);
  }

  std::string cannotTurn(int node, const SpringEnd& end) const {
    if (end.slave < 0)
      return "node " + id(node) +
             " has no rotations for the rotational stiffness or damping to act on; "
             "give it rotations = true";
    const Bond& b = bonds[end.slave];
    return "slave " + id(node) + " cannot take a moment: the nodes of segment " + segmentId(b.segment) + " of tie '" +
           scene.ties[b.tie].name + "' have no rotations; use formulation = \"optimized\"";
  }

  // Finds the nodes of the port in the model; keeps it if it is one of slaves, or of driven nodes, as asked.
  void placePort(int k, bool ofSlaves) {
    const ScenePort& spec = scene.ports[k];
    const std::string where = "interface: port '" + spec.name + "': ";
    Port port;
    port.name = spec.name;
    port.number = k + 1;
    int slave = -1, other = -1;
    for (int node : spec.nodes) {
      if (!bound[node] && nodeIndex[node] < 0) {
        if (spec.listed) throw SceneError(where + "node " + id(node) + ": no tie and no spring uses it");
        continue;
      }
      (bound[node] ? slave : other) = node;
      if (!bound[node] && scene.nodes.motion[node] != Motion::driven)
        throw SceneError(where + "node " + id(node) + ": is " +
                         (scene.nodes.motion[node] == Motion::free ? "free" : "fixed") +
                         "; a port moves driven nodes or loads slaves");
      if (slave >= 0 && other >= 0)
        throw SceneError(where + "holds slaves (node " + id(slave) + ") and nodes that are none (node " + id(other) +
                         "); make two ports of them");
      port.member.push_back(bound[node] ? slaveIndex[node] : nodeIndex[node]);
    }
    if (port.member.empty()) throw SceneError(where + "no tie and no spring uses any of its nodes");
    port.ofSlaves = slave >= 0;
    if (port.ofSlaves != ofSlaves) return;
    if (port.member.size() < spec.nodes.size())
      note(where + std::to_string(spec.nodes.size() - port.member.size()) + " of " + std::to_string(spec.nodes.size()) +
           " nodes left out: no tie and no spring uses them");
    std::sort(port.member.begin(), port.member.end());
    const auto position = [&](int member) {
      return port.ofSlaves ? scene.nodes.position[bonds[member].slave] : Vec3(at(model.nodePosition.data(), member));
    };
    Vec3 mean = Vec3::Zero();
    for (int member : port.member) mean += position(member) / static_cast<double>(port.member.size());
    port.place = spec.atMean ? mean : spec.at;
    if (port.ofSlaves) port.lever = port.place - mean;
    for (int member : port.member) {
      const Vec3 arm = position(member) - (port.ofSlaves ? mean : port.place);
      port.arm.insert(port.arm.end(), arm.begin(), arm.end());
    }
    if (port.ofSlaves)
      resolveTurn(port, where);
    else
      startMotion(port, where);
    model.ports.push_back(std::move(port));
  }

  // Slaves on a line leave the rotation about it open; their own rotations decide it.
  void resolveTurn(Port& port, const std::string& where) {
    const Vec3 eigenvalue = armInertia(port.arm).selfadjointView<Eigen::Lower>().eigenvalues();
    if (eigenvalue[0] * conditionRefused >= eigenvalue[2] && eigenvalue[2] > 0) return;
    const bool turning =
        std::any_of(port.member.begin(), port.member.end(), [&](int s) { return s < model.turningSlaves; });
    if (!turning)
      throw SceneError(where + (port.member.size() > 1 ? "its slaves are collinear and" : "its only slave") +
                       " cannot turn, which leaves its rotation open; use formulation = \"optimized\" or "
                       "rotations = true");
    const double mean2 = 0.5 * eigenvalue.sum() / static_cast<double>(port.member.size());
    port.turnWeight = mean2 > 0 ? mean2 : 1;
    if (port.lever.isZero(0) || !model.finite()) return;
    for (int s : port.member) {
      SpringEnd end;
      end.slave = s;
      if (s < model.turningSlaves) orient(end);
      port.orientation.push_back(end.orientation);
    }
  }

  // The port's velocities at the start from those of its nodes, which must move as one body.
  void startMotion(Port& port, const std::string& where) {
    const std::size_t count = port.member.size();
    Vec3 meanArm = Vec3::Zero(), meanVelocity = Vec3::Zero(), turn = Vec3::Zero();
    double speed = 0;
    for (std::size_t i = 0; i < count; ++i) {
      meanArm += at(port.arm.data(), i) / static_cast<double>(count);
      meanVelocity += at(model.nodeVelocity.data(), port.member[i]) / static_cast<double>(count);
      speed = std::max(speed, at(model.nodeVelocity.data(), port.member[i]).norm());
    }
    std::vector<double> arm = port.arm;
    for (std::size_t i = 0; i < count; ++i) {
      at(arm.data(), i) -= meanArm;
      turn += at(arm.data(), i).cross(at(model.nodeVelocity.data(), port.member[i]));
    }
    const int rotating = *std::min_element(port.member.begin(), port.member.end());
    if (rotating < model.rotating())
      port.spin = at(model.nodeSpin.data(), rotating);
    else if (!turn.isZero(0))
      port.spin = armInertia(arm).completeOrthogonalDecomposition().solve(turn);
    port.velocity = meanVelocity - port.spin.cross(meanArm);
    for (std::size_t i = 0; i < count; ++i) {
      const int node = port.member[i];
      const Vec3 v = port.velocity + port.spin.cross(at(port.arm.data(), i));
      const bool turnsElse = node < model.rotating() && !(at(model.nodeSpin.data(), node) == port.spin);
      if (turnsElse || !((v - at(model.nodeVelocity.data(), node)).norm() <= 1e-9 * speed))
        throw SceneError(where + "node " + std::to_string(model.nodeId[node]) +
                         ": its [[initial]] velocity does not fit a rigid motion of the port's nodes");
    }
  }

  // Without acceleration inputs the driven share of a consistent mass matrix has nothing to multiply.
  void adviseOnInertia() {
    if (scene.settings.inertia != Inertia::consistent || scene.settings.reaction != Reaction::loads) return;
    for (const Bond& b : bonds) {
      bool freeCorner = false, drivenCorner = false;
      for (int i = 0; i < b.corners; ++i) {
        const Motion motion = scene.nodes.motion[scene.segments.nodes[b.segment][i]];
        freeCorner |= motion == Motion::free;
        drivenCorner |= motion == Motion::driven;
      }
      if (freeCorner && drivenCorner && scene.nodes.mass[b.slave] + scene.nodes.inertia[b.slave] > 0) {
        warn(
            "model: reaction 'loads' gives no accelerations of the driven masters, so their share of the slaves' "
            "inertia does not act on the free masters of the same segment (first: segment " +
            segmentId(b.segment) + "); reaction = \"full\" or \"split\" does");
        return;
      }
    }
  }
};

}  // namespace

bool Model::anyDriven() const {
  for (int g : {rotatingDrivenMaster, rotatingDrivenPoint, drivenMaster, drivenPoint})
    if (begin[g + 1] > begin[g]) return true;
  return false;
}

bool Model::shareable() const {
  return std::any_of(groups.begin(), groups.end(), [](const TieGroup& g) { return g.partEnd.size() > 1; });
}

std::size_t Model::drivenPorts() const {
  return static_cast<std::size_t>(std::count_if(ports.begin(), ports.end(), [](const Port& p) { return !p.ofSlaves; }));
}

bool Model::exposes(const char* name) const {
  return std::find(settings.expose.begin(), settings.expose.end(), name) != settings.expose.end();
}

bool Model::needsPositions() const {
  if (!springs.empty() || exposes("slave.r") || exposes("master.r") || exposes("point.r") || exposes("port.r"))
    return true;
  if (settings.position == Position::input && anyDriven()) return true;
  if (!finite()) return false;
  for (const Port& port : ports)
    if (port.ofSlaves && port.member.size() > 1) return true;
  return std::any_of(groups.begin(), groups.end(),
                     [](const TieGroup& g) { return g.coupling == Coupling::meanMotion; });
}

Model compile(const Scene& scene) { return Compiler(scene).run(); }

}  // namespace tiefmu
