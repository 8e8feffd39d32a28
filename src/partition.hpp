// Parts of a surface that threads can take.
#pragma once

#include <vector>

namespace tiefmu {

// Segments in parts, and these in phases: no two parts of a phase touch a common node. What lies between the parts of a
// phase makes those of the next; the last has one part. `order`: the segments one part after the other; `end`: where
// each part ends; `phaseEnd`: how many parts there are up to the end of each phase.
struct Partition { std::vector<int> order, end, phaseEnd; };
// `node`: `corners` node indices per segment. How many parts there are follows from the number of segments alone.
Partition partition(const std::vector<int>& node, int corners);

}  // namespace tiefmu
