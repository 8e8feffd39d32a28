// Orders that keep neighbours together in memory.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "math.hpp"

namespace tiefmu {

// An order of points (m): its k-th entry is the index of the point that comes k-th. Along a Morton curve, or as given
// where that walks at most four times as far from point to point.
std::vector<int> localOrder(const std::vector<Vec3>& points);

// Sorts by the 64-bit `key` of the items; equal keys keep their order. (By eleven bits a time, last ones first.)
template <class Item> void sortByKey(std::vector<Item>& items) {
  constexpr int bits = 11, values = 1 << bits, passes = (64 + bits - 1) / bits;
  if (items.size() < values) {
    std::stable_sort(items.begin(), items.end(), [](const Item& a, const Item& b) { return a.key < b.key; });
    return;
  }
  const auto digit = [](const Item& item, int pass) { return item.key >> (bits * pass) & (values - 1); };
  std::vector<std::array<std::uint32_t, values>> count(passes);
  for (auto& of : count) of.fill(0);
  for (const Item& item : items)
    for (int pass = 0; pass < passes; ++pass) ++count[pass][digit(item, pass)];
  std::vector<Item> sorted(items.size());
  for (int pass = 0; pass < passes; ++pass) {
    auto& place = count[pass];
    if (place[digit(items[0], pass)] == items.size()) continue;  // all the same
    std::uint32_t before = 0;
    for (std::uint32_t& of : place) before += std::exchange(of, before);
    for (const Item& item : items) sorted[place[digit(item, pass)]++] = item;
    std::swap(items, sorted);
  }
}

}  // namespace tiefmu
