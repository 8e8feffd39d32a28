// A tree of boxes: which of many stand near a point.
#pragma once

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "math.hpp"

namespace tiefmu {

struct Box {
  Vec3 low, high;
  // Square of the distance of a point, m2: 0 inside.
  double distance2(const Vec3& s) const { return (low - s).cwiseMax(s - high).cwiseMax(0.0).squaredNorm(); }
};

// Boxes get places so that four after one another stand together, as do the next four, and four such fours, and so on.
class BoxTree {
 public:
  // Returns the box at each place. The order is the same on every system.
  std::vector<int> build(const std::vector<Box>& boxes);
  // Visits the places of boxes no farther from s than `limit()` (m), which may shrink meanwhile; near ones first.
  template <class Limit, class Visit> void visit(const Vec3& s, Limit limit, Visit visit) const;

 private:
  struct Four { double low[3][4], high[3][4]; };
  std::vector<std::vector<Four>> levels_;  // first: fours of boxes, next: of those fours; the last has one
  int count_ = 0;
  int children(int level) const { return level == 0 ? count_ : static_cast<int>(levels_[level - 1].size()); }
};

template <class Limit, class Visit> void BoxTree::visit(const Vec3& s, Limit limit, Visit visit) const {
  if (count_ == 0) return;
  struct Entry {
    double distance2;
    int level, index;
  } stack[64];  // three stay behind on each of at most 16 levels
  int depth = 0;
  stack[depth++] = {0, static_cast<int>(levels_.size()) - 1, 0};
  while (depth > 0) {
    const Entry entry = stack[--depth];
    const double within = limit(), within2 = within * within;
    if (entry.distance2 > within2) continue;
    const Four& four = levels_[entry.level][entry.index];
    double distance2[4] = {0, 0, 0, 0};
    for (int axis = 0; axis < 3; ++axis)
      for (int k = 0; k < 4; ++k) {
        const double below = four.low[axis][k] - s[axis], above = s[axis] - four.high[axis][k];
        const double beside = std::max(std::max(below, above), 0.0);
        distance2[k] += beside * beside;
      }
    Entry near[4];
    int count = 0;
    const int first = 4 * entry.index, last = std::min(4, children(entry.level) - first);
    for (int k = 0; k < last; ++k) {
      if (distance2[k] > within2) continue;
      int place = count++;
      for (; place > 0 && near[place - 1].distance2 > distance2[k]; --place) near[place] = near[place - 1];
      near[place] = {distance2[k], entry.level - 1, first + k};
    }
    if (entry.level > 0) {
      while (count > 0) stack[depth++] = near[--count];  // the nearest on top
      continue;
    }
    for (int k = 0; k < count; ++k) {
      const double now = limit();
      if (near[k].distance2 <= now * now) visit(near[k].index);
    }
  }
}

}  // namespace tiefmu
