#include "ordering.hpp"

#include <numeric>

namespace tiefmu {
namespace {

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
  std::vector<int> order(points.size());
  std::iota(order.begin(), order.end(), 0);
  if (points.size() < 3) return order;
  Vec3 low = points[0], high = points[0];
  double given = 0;  // how far it is from point to point
  for (std::size_t k = 1; k < points.size(); ++k) {
    low = low.cwiseMin(points[k]);
    high = high.cwiseMax(points[k]);
    given += (points[k] - points[k - 1]).norm();
  }
  const double size = (high - low).maxCoeff(), scale = size > 0 ? ((1 << 21) - 1) / size : 0;
  struct Coded {
    std::uint64_t key;
    int index;
  };
  std::vector<Coded> coded(points.size());
  for (int k = 0; k < static_cast<int>(points.size()); ++k) {
    const Vec3 x = scale * (points[k] - low);
    coded[k].key = spread(static_cast<std::uint64_t>(x[0])) | spread(static_cast<std::uint64_t>(x[1])) << 1 |
                   spread(static_cast<std::uint64_t>(x[2])) << 2;
    coded[k].index = k;
  }
  sortByKey(coded);
  double curve = 0;
  for (std::size_t k = 1; k < coded.size() && given > 4 * curve; ++k)
    curve += (points[coded[k].index] - points[coded[k - 1].index]).norm();
  if (given > 4 * curve)
    for (std::size_t k = 0; k < coded.size(); ++k) order[k] = coded[k].index;
  return order;
}

}  // namespace tiefmu
