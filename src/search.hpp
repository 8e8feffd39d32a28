// Which segment holds a slave (theory 7).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "box_tree.hpp"
#include "scene.hpp"
#include "segment.hpp"

namespace tiefmu {

struct Match {
  int segment = -1;       // index into the list the search was made of; -1: not found
  Projection projection;  // its `nearest` is the distance that competes, m
  int rival = -1;         // another segment as near, with its closest point on another side of the slave
  int folded = -1;        // a nearer segment that folds onto itself there (Projection::folded); passed over
  int crossing = -1;      // the nearest segment, which crosses itself: then none is found
};

// Exact: every answer is that of trying all segments. A tree of boxes only leaves out what cannot win.
class SegmentSearch {
 public:
  static constexpr double warnOutside = 1.02;                 // |xi| or |eta|
  static constexpr double maxOutside = Projection::farthest;  // beyond, a segment is no candidate

  // position: of all nodes, m. segments: node indices, fourth -1 for a triangle. ids: for ties between segments.
  SegmentSearch(const std::vector<Vec3>& position, std::vector<std::array<int, 4>> segments,
                std::vector<std::int64_t> ids);

  const std::vector<int>& zeroArea() const { return zeroArea_; }  // passed over
  const std::vector<int>& crossing() const { return crossing_; }  // see crossesItself
  // The default of search_distance, m: the root mean square edge, (7.4), of `box`, the longest diagonal of
  // `nearestNode`.
  double defaultReach(SearchMethod by) const { return by == SearchMethod::box ? edge_ : diagonal_; }

  // take(k, match) for each of `slaves` (m), whose k-th has that match; neighbours after one another.
  void each(SearchMethod by, const std::vector<Vec3>& slaves, double reach,
            const std::function<void(int, Match&)>& take) const;
  // Isearch 2: the segment whose closest point is nearest, at most `reach` away.
  Match box(const Vec3& slave, double reach) const;
  // Isearch 1: of the segments that hold the nearest node, at most `reach` away, the one whose closest point is
  // nearest. Where the slave lies inside none of them, segments on whose edge that node hangs count, too.
  Match nearestNode(const Vec3& slave, double reach) const;
  // The nearest segment however far, whether it can hold the slave or not. (For messages.)
  Match nearest(const Vec3& slave) const;

 private:
  static constexpr double asNear = 1e-3;  // a rival's distance differs by less than this part
  struct Segment {                        // per place in the tree
    Vec3 x[4];
    int index, corners;
    bool crossing;
  };
  struct Candidates {
    double tolerance, nearest, crossing, folded;     // distances, m
    std::vector<std::pair<int, Projection>> usable;  // place, projection
    int crossingPlace = -1, foldedPlace = -1;
    double within() const { return nearest * (1 + asNear) + tolerance; }  // what is farther counts for nothing
  };
  double noise(const Vec3& slave) const;
  void consider(int place, const Vec3& slave, Candidates& candidates) const;
  void hangingAt(const Vec3& slave, double limit, const std::vector<std::pair<double, int>>& holders,
                 Candidates& candidates) const;
  Match decide(const Candidates& candidates) const;

  std::vector<std::int64_t> ids_;
  std::vector<Segment> segments_;
  std::vector<int> zeroArea_, crossing_;
  BoxTree tree_;
  double edge_ = 0, diagonal_ = 0, farthest_ = 0;  // farthest_: largest coordinate, m
};

}  // namespace tiefmu
