// Orders that keep neighbours together in memory.
#pragma once

#include <vector>

#include "math.hpp"

namespace tiefmu {

// An order of points (m): its k-th entry is the index of the point that comes k-th. Along a Morton curve, or as given
// where that walks at most four times as far from point to point.
std::vector<int> localOrder(const std::vector<Vec3>& points);

}  // namespace tiefmu
