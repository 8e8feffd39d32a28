#include "search.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

namespace tiefmu {
namespace {

// Distances that differ by less (of the mean edge, or what the rounding of coordinates leaves) are equal: then the tie
// rule decides, so that the answer does not hang on the frame or the order of the input.
constexpr double roundoff = 1e-10;
constexpr int leaf = 4;           // items of a box that is not divided
constexpr double hanging = 1e-2;  // of a segment's longest diagonal: a node as near to it counts as on it

double distance2(const Vec3& low, const Vec3& high, const Vec3& s) {
  return (low - s).cwiseMax(s - high).cwiseMax(0.0).squaredNorm();
}

}  // namespace

void SegmentSearch::Tree::build(std::vector<Box> boxes) {
  boxes_ = std::move(boxes);
  items_.resize(boxes_.size());
  std::iota(items_.begin(), items_.end(), 0);
  nodes_.clear();
  if (items_.empty()) return;
  nodes_.reserve(boxes_.size());
  nodes_.emplace_back();
  split(0, 0, static_cast<int>(items_.size()));
  boxes.clear();
  for (int i : items_) boxes.push_back(boxes_[i]);
  boxes_ = std::move(boxes);
}

void SegmentSearch::Tree::split(int node, int first, int last) {
  Box box = boxes_[items_[first]];
  for (int i = first + 1; i < last; ++i) {
    box.low = box.low.cwiseMin(boxes_[items_[i]].low);
    box.high = box.high.cwiseMax(boxes_[items_[i]].high);
  }
  nodes_[node] = {box, first, last - first};
  if (last - first <= leaf) return;
  int axis;
  (box.high - box.low).maxCoeff(&axis);
  const int middle = (first + last) / 2;
  std::nth_element(items_.begin() + first, items_.begin() + middle, items_.begin() + last, [&](int a, int b) {
    return boxes_[a].low[axis] + boxes_[a].high[axis] < boxes_[b].low[axis] + boxes_[b].high[axis];
  });
  const int child = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  nodes_.emplace_back();
  nodes_[node].first = child;
  nodes_[node].count = 0;
  split(child, first, middle);
  split(child + 1, middle, last);
}

template <class Limit, class Visit> void SegmentSearch::Tree::visit(const Vec3& s, Limit limit, Visit visit) const {
  if (nodes_.empty()) return;
  std::pair<int, double> stack[128];  // median splits: depth below 64
  int depth = 0;
  stack[depth++] = {0, distance2(nodes_[0].box.low, nodes_[0].box.high, s)};
  while (depth > 0) {
    const auto [index, d2] = stack[--depth];
    const double l = limit();
    if (d2 > l * l) continue;
    const Node& node = nodes_[index];
    if (node.count > 0) {
      std::pair<double, int> near[leaf];
      for (int i = 0; i < node.count; ++i) {
        const Box& box = boxes_[node.first + i];
        near[i] = {distance2(box.low, box.high, s), node.first + i};
        for (int k = i; k > 0 && near[k] < near[k - 1]; --k) std::swap(near[k], near[k - 1]);
      }
      for (int i = 0; i < node.count; ++i) {
        const double within = limit();
        if (near[i].first <= within * within) visit(near[i].second);
      }
      continue;
    }
    const Box &a = nodes_[node.first].box, &b = nodes_[node.first + 1].box;
    const double da = distance2(a.low, a.high, s), db = distance2(b.low, b.high, s);
    // nearer child on top of the stack
    stack[depth++] = da < db ? std::pair{node.first + 1, db} : std::pair{node.first, da};
    stack[depth++] = da < db ? std::pair{node.first, da} : std::pair{node.first + 1, db};
  }
}

SegmentSearch::SegmentSearch(const std::vector<Vec3>& position, std::vector<std::array<int, 4>> segments,
                             std::vector<std::int64_t> ids)
    : ids_(std::move(ids)) {
  std::vector<Box> boxes;
  std::vector<std::pair<int, int>> edges;
  std::vector<int> usable;
  Vec3 x[4];
  const auto corners = [&](int e) {
    const int n = segments[e][3] < 0 ? 3 : 4;
    for (int i = 0; i < n; ++i) x[i] = position[segments[e][i]];
    return n;
  };
  for (int e = 0; e < static_cast<int>(segments.size()); ++e) {
    const int n = corners(e);
    Box box{x[0], x[0]};
    for (int i = 0; i < n; ++i) {
      box.low = box.low.cwiseMin(x[i]);
      box.high = box.high.cwiseMax(x[i]);
      const auto ends = std::minmax(segments[e][i], segments[e][(i + 1) % n]);
      edges.emplace_back(ends.first, ends.second);
      for (int j = 0; j < i; ++j) diagonal_ = std::max(diagonal_, (x[i] - x[j]).squaredNorm());
    }
    const bool crossing = crossesItself(n, x);
    if (crossing) crossing_.push_back(e);
    if (!crossing && tiefmu::zeroArea(n, x)) {
      zeroArea_.push_back(e);
      continue;
    }
    farthest_ = std::max({farthest_, box.low.cwiseAbs().maxCoeff(), box.high.cwiseAbs().maxCoeff()});
    usable.push_back(e);
    boxes.push_back(box);
  }
  diagonal_ = std::sqrt(diagonal_);
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  for (const auto& [a, b] : edges) edge_ += (position[a] - position[b]).squaredNorm();
  edge_ = edges.empty() ? 0 : std::sqrt(edge_ / static_cast<double>(edges.size()));
  segmentTree_.build(std::move(boxes));

  std::vector<std::pair<int, int>> holders;  // node, place
  segments_.reserve(usable.size());
  for (int item : segmentTree_.items()) {
    const int e = usable[item], n = corners(e), place = static_cast<int>(segments_.size());
    Segment segment{{x[0], x[1], x[2], n == 4 ? x[3] : x[0]}, e, n, crossesItself(n, x)};
    segments_.push_back(segment);
    for (int i = 0; i < n; ++i) holders.emplace_back(segments[e][i], place);
  }
  std::sort(holders.begin(), holders.end());
  std::vector<int> nodes, begin;
  std::vector<Box> points;
  for (int k = 0; k < static_cast<int>(holders.size()); ++k) {
    const int node = holders[k].first;
    if (!nodes.empty() && nodes.back() == node) continue;
    nodes.push_back(node);
    begin.push_back(k);
    points.push_back({position[node], position[node]});
  }
  begin.push_back(static_cast<int>(holders.size()));
  nodeTree_.build(std::move(points));
  holders_.reserve(holders.size());
  for (int item : nodeTree_.items()) {
    points_.push_back(position[nodes[item]]);
    holdersBegin_.push_back(static_cast<int>(holders_.size()));
    for (int k = begin[item]; k < begin[item + 1]; ++k) holders_.push_back(holders[k].second);
  }
  holdersBegin_.push_back(static_cast<int>(holders_.size()));
}

double SegmentSearch::noise(const Vec3& slave) const {
  const double most = std::max(farthest_, slave.cwiseAbs().maxCoeff());
  return std::max(roundoff * edge_, 8 * std::numeric_limits<double>::epsilon() * most);
}

void SegmentSearch::consider(int place, const Vec3& slave, Candidates& c) const {
  const Segment& segment = segments_[place];
  const double within = c.within();
  const Projection p = project(segment.corners, segment.x, slave, within);
  if (p.nearest > within) return;
  if (segment.crossing) {
    if (p.nearest < c.crossing) {
      c.crossing = p.nearest;
      c.crossingPlace = place;
    }
  } else if (p.converged && p.folded) {
    if (p.nearest < c.folded) {
      c.folded = p.nearest;
      c.foldedPlace = place;
    }
  } else if (p.converged && p.outside <= maxOutside + roundoff) {
    if (p.nearest * (1 + asNear) + c.tolerance < c.nearest) c.usable.clear();  // what came before is out
    c.nearest = std::min(c.nearest, p.nearest);
    c.usable.emplace_back(place, p);
  }
}

// The tie rule: of segments as near, the smaller max(|xi|, |eta|), then the lower segment id.
Match SegmentSearch::decide(const Candidates& c) const {
  Match match;
  const double tolerance = c.tolerance;
  const double limit = c.nearest * (1 + roundoff) + tolerance;
  const auto segment = [&](int place) { return place < 0 ? -1 : segments_[place].index; };
  if (c.foldedPlace >= 0 && (c.usable.empty() || c.folded < c.nearest - tolerance))
    match.folded = segment(c.foldedPlace);
  if (c.crossingPlace >= 0 && (c.usable.empty() || c.crossing < c.nearest - tolerance)) {
    match.crossing = segment(c.crossingPlace);
    return match;
  }
  double deepest = std::numeric_limits<double>::infinity();
  for (const auto& [place, p] : c.usable)
    if (p.nearest <= limit) deepest = std::min(deepest, p.outside);
  deepest += std::max(roundoff, 4 * tolerance / edge_);
  const Projection* winner = nullptr;
  for (const auto& [place, p] : c.usable)
    if (p.nearest <= limit && p.outside <= deepest && (!winner || ids_[segment(place)] < ids_[match.segment])) {
      winner = &p;
      match.segment = segment(place);
    }
  if (!winner) return match;
  match.projection = *winner;
  // As near elsewhere: the two closest points are seen under more than 60 degrees.
  for (const auto& [place, p] : c.usable)
    if (p.nearest > tolerance && p.nearest <= c.nearest * (1 + asNear) + tolerance &&
        (p.toNearest - winner->toNearest).norm() > p.nearest &&
        (match.rival < 0 || ids_[segment(place)] < ids_[match.rival]))
      match.rival = segment(place);
  return match;
}

Match SegmentSearch::box(const Vec3& slave, double reach) const {
  const double tolerance = noise(slave), infinity = std::numeric_limits<double>::infinity();
  Candidates c{tolerance, reach, infinity, infinity, {}};
  segmentTree_.visit(slave, [&] { return c.within(); }, [&](int place) { consider(place, slave, c); });
  const double within = reach * (1 + roundoff) + tolerance;
  std::erase_if(c.usable, [&](const auto& candidate) { return candidate.second.nearest > within; });
  if (c.crossing > within) c.crossingPlace = -1;
  if (c.folded > within) c.foldedPlace = -1;
  return decide(c);
}

Match SegmentSearch::nearestNode(const Vec3& slave, double reach) const {
  const double tolerance = noise(slave), infinity = std::numeric_limits<double>::infinity();
  double nearest = reach;
  std::vector<std::pair<double, int>> points;
  const auto limit = [&] { return nearest * (1 + roundoff) + tolerance; };
  nodeTree_.visit(slave, limit, [&](int i) {
    const double distance = (points_[i] - slave).norm();
    if (distance > limit()) return;
    nearest = std::min(nearest, distance);
    points.emplace_back(distance, i);
  });
  std::erase_if(points, [&](const auto& point) { return point.first > limit(); });
  Candidates c{tolerance, infinity, infinity, infinity, {}};
  for (const auto& [distance, i] : points)
    for (int k = holdersBegin_[i]; k < holdersBegin_[i + 1]; ++k) consider(holders_[k], slave, c);
  const auto inside = [&](const auto& candidate) { return candidate.second.outside <= 1 + roundoff; };
  if (std::none_of(c.usable.begin(), c.usable.end(), inside))
    for (const auto& [distance, i] : points)
      segmentTree_.visit(
          points_[i], [&] { return hanging * diagonal_; },
          [&](int place) {
            const Segment& segment = segments_[place];
            double size = 0;
            for (int k = 1; k < segment.corners; ++k) size = std::max(size, (segment.x[k] - segment.x[0]).norm());
            if (project(segment.corners, segment.x, points_[i]).nearest <= hanging * size) consider(place, slave, c);
          });
  return decide(c);
}

Match SegmentSearch::nearest(const Vec3& slave) const {
  Match match;
  const double tolerance = noise(slave);
  segmentTree_.visit(
      slave, [&] { return match.projection.nearest; },
      [&](int place) {
        const Segment& segment = segments_[place];
        const Projection p = project(segment.corners, segment.x, slave);
        const bool nearer = p.nearest < match.projection.nearest - tolerance;
        const bool lower = p.nearest <= match.projection.nearest + tolerance && match.segment >= 0 &&
                           ids_[segment.index] < ids_[match.segment];
        if (!nearer && !lower && match.segment >= 0) return;
        match.segment = segment.index;
        match.projection = p;
        match.crossing = segment.crossing ? segment.index : -1;
      });
  return match;
}

}  // namespace tiefmu
