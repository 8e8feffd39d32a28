// Slaves into groups and an order that keeps neighbours together and lets threads share them.
#include <algorithm>
#include <numeric>
#include <tuple>

#include "compilation.hpp"
#include "ordering.hpp"
#include "partition.hpp"

namespace tiefmu {

// Bonds by coupling, shape and segment: segments as localOrder and then `partition` of each group say.
void Compilation::sortBonds() {
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
    for (; last < count && bonds[last].coupling == bonds[first].coupling && bonds[last].corners == bonds[first].corners;
         ++last) {
      const Bond& b = bonds[last];
      if (last == first || b.segment != bonds[last - 1].segment)
        for (int i = 0; i < b.corners; ++i) node.push_back(nodeIndex[scene.segments.nodes[b.segment][i]]);
      segmentOf.push_back(static_cast<int>(node.size()) / b.corners - 1);
    }
    const Partition found = partition(node, bonds[first].corners);
    std::vector<int> place(found.order.size());
    for (int k = 0; k < static_cast<int>(place.size()); ++k) place[found.order[k]] = k;
    for (int k = first; k < last; ++k) rank[k] = place[segmentOf[k - first]];
    parts.push_back(found);
  }
  sort(rank);
}

void Compilation::placeSlaves() {
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
  int lastSegment = -1;
  for (int s = 0; s < static_cast<int>(bonds.size()); ++s) {
    const Bond& b = bonds[s];
    if (model.groups.empty() || model.groups.back().coupling != b.coupling ||
        model.groups.back().corners != b.corners) {
      model.groups.push_back(
          {b.coupling, b.corners, s, {}, {0}, {}, parts[model.groups.size()].end, parts[model.groups.size()].phaseEnd});
      lastSegment = -1;
    }
    TieGroup& group = model.groups.back();
    if (b.segment != lastSegment) {
      lastSegment = b.segment;
      for (int i = 0; i < b.corners; ++i) group.node.push_back(nodeIndex[scene.segments.nodes[b.segment][i]]);
      group.begin.push_back(group.begin.back());
      if (kinematicsOf(b.coupling).segmentsTurn) ++meanMotionSegments;
    }
    ++group.begin.back();
    segmentRotation.push_back(kinematicsOf(b.coupling).segmentsTurn ? meanMotionSegments - 1 : -1);
    group.weight.insert(group.weight.end(), b.projection.phi.begin(), b.projection.phi.begin() + b.corners);

    const int node = b.slave;
    slaveIndex[node] = s;
    if (kinematicsOf(b.coupling).slavesTurn) model.turningSlaves = s + 1;
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

}  // namespace tiefmu
