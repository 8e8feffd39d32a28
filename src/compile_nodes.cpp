// Independent nodes into their groups.
#include <algorithm>

#include "compilation.hpp"
#include "ordering.hpp"

namespace tiefmu {

void Compilation::placeNodes() {
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

}  // namespace tiefmu
