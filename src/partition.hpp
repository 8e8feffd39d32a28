// Parts of a surface that threads can take.
#pragma once

#include <vector>

namespace tiefmu {

// Segments in parts of which no two touch a common node, and the separator: the segments between them, which may touch
// any. `order`: the parts' segments one part after the other, then the separator's; `end`: where each part ends, the
// last where the separator begins.
struct Partition { std::vector<int> order, end; };
// `node`: `corners` node indices per segment. How many parts there are follows from the number of segments alone.
Partition partition(const std::vector<int>& node, int corners);

}  // namespace tiefmu
