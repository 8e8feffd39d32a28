#include "ordering.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace tiefmu {
namespace {

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

}  // namespace tiefmu
