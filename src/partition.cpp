#include "partition.hpp"

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <numeric>

namespace tiefmu {
namespace {

constexpr int segmentsAPart = 1024, mostParts = 32, mostPhases = 4;

}  // namespace

Partition partition(const std::vector<int>& node, int corners) {
  assert((corners == 3 || corners == 4) && node.size() % corners == 0);
  Partition result;
  std::vector<int> left(node.size() / corners);
  std::iota(left.begin(), left.end(), 0);
  constexpr int nobody = -1, several = -2;
  std::vector<int> owner(node.empty() ? 0 : *std::max_element(node.begin(), node.end()) + 1);
  for (int phase = 0; phase == 0 || !left.empty(); ++phase) {
    const int segments = static_cast<int>(left.size());
    const int parts = phase + 1 < mostPhases ? std::clamp(segments / segmentsAPart, 1, mostParts) : 1;
    const auto partOf = [&](int k) { return static_cast<int>(static_cast<std::int64_t>(k) * parts / segments); };
    std::fill(owner.begin(), owner.end(), nobody);
    for (int k = 0; k < segments; ++k)
      for (int i = 0; i < corners; ++i) {
        int& of = owner[node[corners * left[k] + i]];
        of = of == nobody || of == partOf(k) ? partOf(k) : several;
      }
    std::vector<int> between;
    for (int k = 0; k < segments; ++k) {
      const auto first = node.begin() + corners * left[k];
      const bool inside = std::none_of(first, first + corners, [&](int n) { return owner[n] == several; });
      (inside ? result.order : between).push_back(left[k]);
      if (k + 1 == segments || partOf(k + 1) != partOf(k)) result.end.push_back(static_cast<int>(result.order.size()));
    }
    if (segments == 0) result.end.push_back(0);
    result.phaseEnd.push_back(static_cast<int>(result.end.size()));
    left = std::move(between);
  }
  return result;
}

}  // namespace tiefmu
