// The consistent mass matrix where segments stand alone: a segment that shares no free node with another is solved by
// itself, directly, in one pass over its loads (theory 4).
#pragma once

#include <string>
#include <vector>

#include "model.hpp"
#include "segment_solve.hpp"
#include "ties.hpp"

namespace tiefmu {

// Which segments these are: all of whose free corners are different, theirs only, and heavy enough by themselves.
struct SegmentsAlone {
  explicit SegmentsAlone(const Model& model);
  std::vector<std::vector<std::uint8_t>> held;  // per group: 1 for these segments
  std::vector<int> rest;                        // free nodes, from 0, of the others
  std::vector<int> own, ownTurning;             // free nodes, from 0, that no slave weighs on (turns)
  bool allFree = true;                          // is every corner of every segment free?
};

class Islands {
 public:
  explicit Islands(const Model& model);

  const SegmentsAlone& alone() const { return alone_; }

  // What is constant, from the slaves' masses (kg, kg m2). Throws SceneError naming a free node without inertia.
  void update(const double* slaveMass, const double* slaveInertia);
  // Accelerations of the free nodes that are not among the rest (a: 3 per node, z: 3 per rotating node). Returns the
  // largest |w|^2 of a slave, (rad/s)^2; 0 without `loads.velocity`.
  double solve(const Ties& ties, const SegmentLoads& loads, double* a, double* z);

 private:
  enum class Kind : int { translation, pair, many, body };
  static constexpr int kinds = 4;
  struct List {
    int group;
    Kind kind;
    bool mixed;
    std::vector<int> segment;
    std::vector<double> planes;
  };
  struct Piece {
    std::size_t list;
    int first, count;
  };

  void addLists(std::size_t group);
  void fill(List& list, std::size_t place, const double* slaveMass, const double* slaveInertia);

  const Model& model_;
  SegmentsAlone alone_;
  std::vector<List> lists_;
  std::vector<Piece> pieces_;
  std::vector<double> fastest_;  // per piece
};

}  // namespace tiefmu
