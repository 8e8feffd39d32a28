// Which segment holds a slave (theory 7).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "segment.hpp"

namespace tiefmu {

struct Match {
  int segment = -1;  // index into the list the search was made of; -1: not found
  Projection projection;
  double distance = 0;   // what it competed with: orthogonal if interior, to its nearest node if exterior, m
  int unconverged = -1;  // a candidate on which the projection did not converge
};

// Exact: every answer is that of trying all segments. A tree of boxes only leaves out what cannot win.
class SegmentSearch {
 public:
  static constexpr double warnOutside = 1.02;  // |xi| or |eta|
  static constexpr double maxOutside = 1.5;

  // position: of all nodes, m. segments: node indices, fourth -1 for a triangle. ids: for ties between segments.
  SegmentSearch(std::vector<Vec3> position, std::vector<std::array<int, 4>> segments, std::vector<std::int64_t> ids);

  const std::vector<int>& zeroArea() const { return zeroArea_; }  // passed over
  double defaultDistance() const { return edge_; }                // root mean square of the edges, m

  // Isearch 2: the segment with the smallest competing distance, at most `reach` away.
  Match box(const Vec3& slave, double reach) const;
  // Isearch 1: of the segments that hold the nearest node inside the box of side `side` round the slave, the one whose
  // projection lies deepest inside.
  Match nearestNode(const Vec3& slave, double side) const;

 private:
  struct Box { Vec3 low, high; };
  class Tree {
   public:
    void build(std::vector<Box> boxes);
    // Visits items in boxes nearer than `limit()`, which may shrink meanwhile.
    template <class Limit, class Visit> void visit(const Vec3& s, Limit limit, Visit visit) const;

   private:
    struct Node {
      Box box;
      int first, count;
    };  // count > 0: leaf; else children at first and first + 1
    std::vector<Node> nodes_;
    std::vector<int> items_;
    std::vector<Box> boxes_;
    void split(int node, int first, int last);
  };
  int corners(int e, Vec3* x) const;
  Match best(const std::vector<Match>& candidates, double tolerance) const;

  std::vector<Vec3> position_;
  std::vector<std::array<int, 4>> segments_;
  std::vector<std::int64_t> ids_;
  std::vector<int> zeroArea_, nodes_;        // nodes_: those of usable segments
  std::vector<int> holdersBegin_, holders_;  // per entry of nodes_: the segments that hold it
  Tree segmentTree_, nodeTree_;
  double edge_ = 0;
};

}  // namespace tiefmu
