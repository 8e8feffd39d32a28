// Orders that keep neighbours together in memory, and parts of a surface that threads can take.
#pragma once

#include <vector>

#include "math.hpp"

namespace tiefmu {

// An order of points (m): its k-th entry is the index of the point that comes k-th. Along a Morton curve, or as given
// where that walks at most four times as far from point to point.
std::vector<int> localOrder(const std::vector<Vec3>& points);

// Segments (`corners` node indices each, by index in the model) split in parts of which no two touch a common node, and
// a border that may touch any. `order`: the parts' segments one part after the other, then the border's; `end`: where
// each part ends, the last at the beginning of the border. How many parts follows from the number of segments alone.
struct Parts { std::vector<int> order, end; };
Parts split(const std::vector<int>& node, int corners);

}  // namespace tiefmu
