#include "box_tree.hpp"

namespace tiefmu {
namespace {

struct Item {
  Vec3 centre;  // twice
  int index;
};

// Halves at multiples of the largest power of four that fits, across the longer side, until four are left.
void arrange(std::vector<Item>& items, int first, int last) {
  if (last - first <= 4) return;
  int block = 4;
  while (block < (last - first + 3) / 4) block *= 4;
  const int blocks = (last - first + block - 1) / block, middle = first + (blocks + 1) / 2 * block;
  Vec3 low = items[first].centre, high = low;
  for (int k = first + 1; k < last; ++k) {
    low = low.cwiseMin(items[k].centre);
    high = high.cwiseMax(items[k].centre);
  }
  int axis;
  (high - low).maxCoeff(&axis);
  std::nth_element(items.begin() + first, items.begin() + middle, items.begin() + last,
                   [&](const Item& a, const Item& b) {
                     return a.centre[axis] != b.centre[axis] ? a.centre[axis] < b.centre[axis] : a.index < b.index;
                   });
  arrange(items, first, middle);
  arrange(items, middle, last);
}

}  // namespace

std::vector<int> BoxTree::build(const std::vector<Box>& boxes) {
  count_ = static_cast<int>(boxes.size());
  levels_.clear();
  std::vector<Item> items;
  items.reserve(boxes.size());
  for (int k = 0; k < count_; ++k) items.push_back({boxes[k].low + boxes[k].high, k});
  arrange(items, 0, count_);
  std::vector<int> order;
  order.reserve(items.size());
  for (const Item& item : items) order.push_back(item.index);

  std::vector<Box> level, next;
  level.reserve(boxes.size());
  for (int k : order) level.push_back(boxes[k]);
  while (!level.empty()) {
    std::vector<Four> fours((level.size() + 3) / 4);
    next.clear();
    for (std::size_t k = 0; k < level.size(); ++k) {
      const Box& box = level[k];
      for (int axis = 0; axis < 3; ++axis) {
        fours[k / 4].low[axis][k % 4] = box.low[axis];
        fours[k / 4].high[axis][k % 4] = box.high[axis];
      }
      if (k % 4 == 0) {
        next.push_back(box);
      } else {
        next.back().low = next.back().low.cwiseMin(box.low);
        next.back().high = next.back().high.cwiseMax(box.high);
      }
    }
    levels_.push_back(std::move(fours));
    if (next.size() == 1) break;
    std::swap(level, next);
  }
  return order;
}

}  // namespace tiefmu
