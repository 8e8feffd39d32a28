#include "search.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "ordering.hpp"

namespace tiefmu {
namespace {

// Distances that differ by less (of the mean edge, or what the rounding of coordinates leaves) are equal: then the tie
// rule decides, so that the answer does not hang on the frame or the order of the input.
constexpr double roundoff = 1e-10;
constexpr double hanging = 1e-2;  // of a segment's longest diagonal: a node as near to it counts as on it

Box boxOf(int n, const Vec3* corner) {
  Box box{corner[0], corner[0]};
  for (int i = 1; i < n; ++i) {
    box.low = box.low.cwiseMin(corner[i]);
    box.high = box.high.cwiseMax(corner[i]);
  }
  return box;
}

}  // namespace

SegmentSearch::SegmentSearch(const std::vector<Vec3>& position, std::vector<std::array<int, 4>> segments,
                             std::vector<std::int64_t> ids)
    : ids_(std::move(ids)) {
  struct Edge {
    std::uint64_t key;  // of its nodes, the lower one first
    double length2;
  };
  std::vector<Edge> edges;
  std::vector<Segment> usable;
  std::vector<Box> boxes;
  edges.reserve(4 * segments.size());
  usable.reserve(segments.size());
  boxes.reserve(segments.size());
  for (int e = 0; e < static_cast<int>(segments.size()); ++e) {
    const std::array<int, 4>& node = segments[e];
    const int n = node[3] < 0 ? 3 : 4;
    Segment segment{{}, e, n, false};
    Vec3* x = segment.x;
    for (int i = 0; i < n; ++i) x[i] = position[node[i]];
    for (int i = 0; i < n; ++i) {
      const int next = (i + 1) % n;
      const auto [low, high] = std::minmax(node[i], node[next]);
      edges.push_back(
          {static_cast<std::uint64_t>(low) << 32 | static_cast<std::uint64_t>(high), (x[next] - x[i]).squaredNorm()});
      for (int j = 0; j < i; ++j) diagonal_ = std::max(diagonal_, (x[i] - x[j]).squaredNorm());
    }
    segment.crossing = crossesItself(n, x);
    if (segment.crossing) crossing_.push_back(e);
    if (!segment.crossing && tiefmu::zeroArea(n, x)) {
      zeroArea_.push_back(e);
      continue;
    }
    boxes.push_back(boxOf(n, x));
    farthest_ = std::max({farthest_, boxes.back().low.cwiseAbs().maxCoeff(), boxes.back().high.cwiseAbs().maxCoeff()});
    usable.push_back(segment);
  }
  diagonal_ = std::sqrt(diagonal_);
  sortByKey(edges);
  std::size_t count = 0;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (k > 0 && edges[k].key == edges[k - 1].key) continue;
    edge_ += edges[k].length2;
    ++count;
  }
  edge_ = count == 0 ? 0 : std::sqrt(edge_ / static_cast<double>(count));
  segments_.reserve(usable.size());
  for (int k : tree_.build(boxes)) segments_.push_back(usable[k]);
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

// What one slave reads is still at hand for the next; slaves are copied first, as reading them far apart waits less so.
void SegmentSearch::each(SearchMethod by, const std::vector<Vec3>& slaves, double reach,
                         const std::function<void(int, Match&)>& take) const {
  const std::vector<int> order = localOrder(slaves);
  std::vector<Vec3> places;
  places.reserve(order.size());
  for (int k : order) places.push_back(slaves[k]);
  for (std::size_t i = 0; i < order.size(); ++i) {
    Match match = by == SearchMethod::box ? box(places[i], reach) : nearestNode(places[i], reach);
    take(order[i], match);
  }
}

Match SegmentSearch::box(const Vec3& slave, double reach) const {
  const double tolerance = noise(slave), infinity = std::numeric_limits<double>::infinity();
  Candidates c{tolerance, reach, infinity, infinity, {}};
  tree_.visit(slave, [&] { return c.within(); }, [&](int place) { consider(place, slave, c); });
  const double within = reach * (1 + roundoff) + tolerance;
  std::erase_if(c.usable, [&](const auto& candidate) { return candidate.second.nearest > within; });
  if (c.crossing > within) c.crossingPlace = -1;
  if (c.folded > within) c.foldedPlace = -1;
  return decide(c);
}

Match SegmentSearch::nearestNode(const Vec3& slave, double reach) const {
  const double tolerance = noise(slave), infinity = std::numeric_limits<double>::infinity();
  double nearest = reach;
  const auto limit = [&] { return nearest * (1 + roundoff) + tolerance; };
  std::vector<std::pair<double, int>> holders;  // distance of the nearest corner, place
  tree_.visit(slave, limit, [&](int place) {
    const Segment& segment = segments_[place];
    double distance2 = infinity;
    for (int i = 0; i < segment.corners; ++i) distance2 = std::min(distance2, (segment.x[i] - slave).squaredNorm());
    const double distance = std::sqrt(distance2);
    if (distance > limit()) return;
    nearest = std::min(nearest, distance);
    holders.emplace_back(distance, place);
  });
  std::erase_if(holders, [&](const auto& holder) { return holder.first > limit(); });
  Candidates c{tolerance, infinity, infinity, infinity, {}};
  for (auto& [order, place] : holders) order = boxOf(segments_[place].corners, segments_[place].x).distance2(slave);
  std::sort(holders.begin(), holders.end());
  for (const auto& [distance2, place] : holders)
    if (distance2 <= c.within() * c.within()) consider(place, slave, c);
  std::erase_if(c.usable, [&](const auto& candidate) { return candidate.second.nearest > c.within(); });
  const auto inside = [&](const auto& candidate) { return candidate.second.outside <= 1 + roundoff; };
  if (std::none_of(c.usable.begin(), c.usable.end(), inside)) hangingAt(slave, limit(), holders, c);
  return decide(c);
}

// Segments on whose edge a node of the holders hangs that is no farther than `limit` from the slave.
void SegmentSearch::hangingAt(const Vec3& slave, double limit, const std::vector<std::pair<double, int>>& holders,
                              Candidates& c) const {
  std::vector<Vec3> points;
  for (const auto& [distance2, place] : holders)
    for (int i = 0; i < segments_[place].corners; ++i) {
      const Vec3& x = segments_[place].x[i];
      if ((x - slave).norm() <= limit && std::find(points.begin(), points.end(), x) == points.end())
        points.push_back(x);
    }
  for (const Vec3& point : points)
    tree_.visit(
        point, [&] { return hanging * diagonal_; },
        [&](int place) {
          const Segment& segment = segments_[place];
          double size = 0;
          for (int k = 1; k < segment.corners; ++k) size = std::max(size, (segment.x[k] - segment.x[0]).norm());
          if (project(segment.corners, segment.x, point).nearest <= hanging * size) consider(place, slave, c);
        });
}

Match SegmentSearch::nearest(const Vec3& slave) const {
  const double tolerance = noise(slave);
  double nearest = std::numeric_limits<double>::max();
  std::vector<std::pair<int, Projection>> near;  // place, projection
  tree_.visit(
      slave, [&] { return nearest; },
      [&](int place) {
        const Segment& segment = segments_[place];
        const Projection p = project(segment.corners, segment.x, slave);
        if (p.nearest > nearest) return;
        nearest = std::min(nearest, p.nearest + tolerance);
        near.emplace_back(place, p);
      });
  Match match;
  for (const auto& [place, p] : near) {
    const Segment& segment = segments_[place];
    if (p.nearest > nearest || (match.segment >= 0 && ids_[match.segment] < ids_[segment.index])) continue;
    match.segment = segment.index;
    match.projection = p;
    match.crossing = segment.crossing ? segment.index : -1;
  }
  return match;
}

}  // namespace tiefmu
