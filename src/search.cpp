#include "search.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

namespace tiefmu {
namespace {

// Distances that differ by less are equal up to rounding: then the tie rule decides, so that the answer does not hang
// on the frame or the order of the input.
constexpr double roundoff = 1e-10;
constexpr double interior = 1 + 1e-9;

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
}

void SegmentSearch::Tree::split(int node, int first, int last) {
  Box box = boxes_[items_[first]];
  for (int i = first + 1; i < last; ++i) {
    box.low = box.low.cwiseMin(boxes_[items_[i]].low);
    box.high = box.high.cwiseMax(boxes_[items_[i]].high);
  }
  nodes_[node] = {box, first, last - first};
  if (last - first <= 4) return;
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
      for (int i = node.first; i < node.first + node.count; ++i) visit(items_[i]);
      continue;
    }
    const Box &a = nodes_[node.first].box, &b = nodes_[node.first + 1].box;
    const double da = distance2(a.low, a.high, s), db = distance2(b.low, b.high, s);
    // nearer child on top of the stack
    stack[depth++] = da < db ? std::pair{node.first + 1, db} : std::pair{node.first, da};
    stack[depth++] = da < db ? std::pair{node.first, da} : std::pair{node.first + 1, db};
  }
}

SegmentSearch::SegmentSearch(std::vector<Vec3> position, std::vector<std::array<int, 4>> segments,
                             std::vector<std::int64_t> ids)
    : position_(std::move(position)), segments_(std::move(segments)), ids_(std::move(ids)) {
  std::vector<Box> boxes;
  std::vector<std::pair<int, int>> edges, holders;
  Vec3 x[4];
  for (int e = 0; e < static_cast<int>(segments_.size()); ++e) {
    const int n = corners(e, x);
    Box box{x[0], x[0]};
    for (int i = 0; i < n; ++i) {
      box.low = box.low.cwiseMin(x[i]);
      box.high = box.high.cwiseMax(x[i]);
      const auto ends = std::minmax(segments_[e][i], segments_[e][(i + 1) % n]);
      edges.emplace_back(ends.first, ends.second);
    }
    if (tiefmu::zeroArea(n, x)) {
      zeroArea_.push_back(e);
      const double far = std::numeric_limits<double>::max() / 4;
      box = {Vec3::Constant(far), Vec3::Constant(far)};  // out of reach of every slave
    } else {
      for (int i = 0; i < n; ++i) holders.emplace_back(segments_[e][i], e);
    }
    boxes.push_back(box);
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  for (const auto& [a, b] : edges) edge_ += (position_[a] - position_[b]).squaredNorm();
  edge_ = edges.empty() ? 0 : std::sqrt(edge_ / static_cast<double>(edges.size()));
  segmentTree_.build(std::move(boxes));

  std::sort(holders.begin(), holders.end());
  std::vector<Box> points;
  for (const auto& [node, e] : holders) {
    if (nodes_.empty() || nodes_.back() != node) {
      nodes_.push_back(node);
      holdersBegin_.push_back(static_cast<int>(holders_.size()));
      points.push_back({position_[node], position_[node]});
    }
    holders_.push_back(e);
  }
  holdersBegin_.push_back(static_cast<int>(holders_.size()));
  nodeTree_.build(std::move(points));
}

int SegmentSearch::corners(int e, Vec3* x) const {
  const auto& nodes = segments_[e];
  const int n = nodes[3] < 0 ? 3 : 4;
  for (int i = 0; i < n; ++i) x[i] = position_[nodes[i]];
  return n;
}

// The tie rule: smaller max(|xi|, |eta|), then the lower segment id.
Match SegmentSearch::best(const std::vector<Match>& candidates, double limit) const {
  const Match* winner = nullptr;
  for (const Match& c : candidates) {
    if (c.distance > limit) continue;
    if (!winner || c.projection.outside < winner->projection.outside - roundoff ||
        (c.projection.outside <= winner->projection.outside + roundoff && ids_[c.segment] < ids_[winner->segment]))
      winner = &c;
  }
  return winner ? *winner : Match{};
}

Match SegmentSearch::box(const Vec3& slave, double reach) const {
  std::vector<Match> candidates;
  const double slack = 1 + roundoff, tolerance = roundoff * edge_;
  double nearest = reach;
  int unconverged = -1;
  Vec3 x[4];
  segmentTree_.visit(
      slave, [&] { return nearest * slack + tolerance; },
      [&](int e) {
        const int n = corners(e, x);
        Match match{e, project(n, x, slave), 0, -1};
        if (!match.projection.converged) {
          unconverged = e;
          return;
        }
        if (match.projection.outside > maxOutside) return;
        match.distance = match.projection.distance;
        if (match.projection.outside > interior) {
          match.distance = std::numeric_limits<double>::infinity();
          for (int i = 0; i < n; ++i) match.distance = std::min(match.distance, (x[i] - slave).norm());
        }
        if (match.distance > nearest * slack + tolerance) return;
        nearest = std::min(nearest, match.distance);
        candidates.push_back(match);
      });
  Match match = best(candidates, nearest * slack + tolerance);
  match.unconverged = unconverged;
  return match;
}

Match SegmentSearch::nearestNode(const Vec3& slave, double side) const {
  const double slack = 1 + roundoff, tolerance = roundoff * edge_;
  const double half = 0.5 * side * slack;
  double nearest = std::sqrt(3.0) * half;
  std::vector<std::pair<double, int>> nodes;
  nodeTree_.visit(
      slave, [&] { return nearest * slack + tolerance; },
      [&](int i) {
        const Vec3 gap = position_[nodes_[i]] - slave;
        if (gap.cwiseAbs().maxCoeff() > half || gap.norm() > nearest * slack + tolerance) return;
        nearest = std::min(nearest, gap.norm());
        nodes.emplace_back(gap.norm(), i);
      });
  std::vector<Match> candidates;
  int unconverged = -1;
  Vec3 x[4];
  for (const auto& [distance, i] : nodes) {
    if (distance > nearest * slack + tolerance) continue;
    for (int k = holdersBegin_[i]; k < holdersBegin_[i + 1]; ++k) {
      const int e = holders_[k];
      Match match{e, project(corners(e, x), x, slave), distance, -1};
      if (!match.projection.converged)
        unconverged = e;
      else if (match.projection.outside <= maxOutside)
        candidates.push_back(match);
    }
  }
  Match match = best(candidates, std::numeric_limits<double>::infinity());
  match.unconverged = unconverged;
  return match;
}

}  // namespace tiefmu
