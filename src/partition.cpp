#include "partition.hpp"

#include <algorithm>
#include <cassert>
#include <cstdint>

namespace tiefmu {
namespace {

constexpr int segmentsAPart = 1024, mostParts = 32;

}  // namespace

Partition partition(const std::vector<int>& node, int corners) {
  assert((corners == 3 || corners == 4) && node.size() % corners == 0);
  const int segments = static_cast<int>(node.size()) / corners;
  const int parts = std::clamp(segments / segmentsAPart, 1, mostParts);
  const auto partOf = [&](int e) { return static_cast<int>(static_cast<std::int64_t>(e) * parts / segments); };
  constexpr int nobody = -1, several = -2;
  std::vector<int> owner(node.empty() ? 0 : *std::max_element(node.begin(), node.end()) + 1, nobody);
  for (int k = 0; k < static_cast<int>(node.size()); ++k) {
    int& of = owner[node[k]];
    const int part = partOf(k / corners);
    of = of == nobody || of == part ? part : several;
  }
  Partition result;
  std::vector<int> separator;
  for (int e = 0; e < segments; ++e) {
    const auto shared = [&](int n) { return owner[n] == several; };
    const bool inside = std::none_of(node.begin() + corners * e, node.begin() + corners * (e + 1), shared);
    (inside ? result.order : separator).push_back(e);
    if (e + 1 == segments || partOf(e + 1) != partOf(e)) result.end.push_back(static_cast<int>(result.order.size()));
  }
  result.order.insert(result.order.end(), separator.begin(), separator.end());
  return result;
}

}  // namespace tiefmu
