// Which segment holds a slave (theory 7).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

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
  double rootMeanSquareEdge() const { return edge_; }             // m
  double longestDiagonal() const { return diagonal_; }            // m

  // Isearch 2: the segment whose closest point is nearest, at most `reach` away.
  Match box(const Vec3& slave, double reach) const;
  // Isearch 1: of the segments that hold the nearest node, at most `reach` away, the one whose closest point is
  // nearest. Where the slave lies inside none of them, segments on whose edge that node hangs count, too.
  Match nearestNode(const Vec3& slave, double reach) const;
  // The nearest segment however far, whether it can hold the slave or not. (For messages.)
  Match nearest(const Vec3& slave) const;

 private:
  static constexpr double asNear = 1e-3;  // a rival's distance differs by less than this part
  struct Box { Vec3 low, high; };
  class Tree {
   public:
    void build(std::vector<Box> boxes);
    const std::vector<int>& items() const { return items_; }  // in the order of their places
    // Visits the places of items whose boxes are nearer than `limit()`, which may shrink meanwhile.
    template <class Limit, class Visit> void visit(const Vec3& s, Limit limit, Visit visit) const;

   private:
    struct Node {
      Box box;
      int first, count;
    };  // count > 0: leaf; else children at first and first + 1
    std::vector<Node> nodes_;
    std::vector<int> items_;
    std::vector<Box> boxes_;  // per place
    void split(int node, int first, int last);
  };
  struct Segment {  // per place in the tree
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
  Match decide(const Candidates& candidates) const;

  std::vector<std::int64_t> ids_;
  std::vector<Segment> segments_;
  std::vector<Vec3> points_;  // of usable segments' nodes, in the order of their places in the tree
  std::vector<int> zeroArea_, crossing_;
  std::vector<int> holdersBegin_, holders_;  // per point: the places of the segments that hold it
  Tree segmentTree_, nodeTree_;
  double edge_ = 0, diagonal_ = 0, farthest_ = 0;  // farthest_: largest coordinate, m
};

}  // namespace tiefmu
