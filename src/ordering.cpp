#include "ordering.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace tiefmu {
namespace {

constexpr int segmentsAPart = 1024, mostParts = 32;

double walk(const std::vector<Vec3>& points, const std::vector<int>& order) {
  double length = 0;
  for (std::size_t k = 1; k < order.size(); ++k) length += (points[order[k]] - points[order[k - 1]]).norm();
  return length;
}

// Bits of a 21-bit number, two zeros after each.
std::uint64_t spread(std::uint64_t x) {
  x = (x | x << 32) & 0x1f00000000ffff;
  x = (x | x << 16) & 0x1f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}

}  // namespace

std::vector<int> localOrder(const std::vector<Vec3>& points) {
  std::vector<int> given(points.size());
  std::iota(given.begin(), given.end(), 0);
  if (points.size() < 3) return given;
  Vec3 low = points[0], high = points[0];
  for (const Vec3& x : points) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  const double size = (high - low).maxCoeff(), scale = size > 0 ? ((1 << 21) - 1) / size : 0;
  std::vector<std::uint64_t> code(points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vec3 x = scale * (points[k] - low);
    code[k] = spread(static_cast<std::uint64_t>(x[0])) | spread(static_cast<std::uint64_t>(x[1])) << 1 |
              spread(static_cast<std::uint64_t>(x[2])) << 2;
  }
  std::vector<int> order = given;
  std::sort(order.begin(), order.end(), [&](int a, int b) { return code[a] != code[b] ? code[a] < code[b] : a < b; });
  return walk(points, given) <= 4 * walk(points, order) ? given : order;
}

Parts split(const std::vector<int>& node, int corners) {
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
  Parts result;
  std::vector<int> border;
  for (int e = 0; e < segments; ++e) {
    const auto shared = [&](int n) { return owner[n] == several; };
    const bool inside = std::none_of(node.begin() + corners * e, node.begin() + corners * (e + 1), shared);
    (inside ? result.order : border).push_back(e);
    if (e + 1 == segments || partOf(e + 1) != partOf(e)) result.end.push_back(static_cast<int>(result.order.size()));
  }
  result.order.insert(result.order.end(), border.begin(), border.end());
  return result;
}

}  // namespace tiefmu
