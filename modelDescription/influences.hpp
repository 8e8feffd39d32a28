// How known vectors (inputs, parameters) enter the vectors that the model computes, before any equation is solved.
#pragma once

#include <cstdint>
#include <vector>

#include "pattern.hpp"
#include "variables.hpp"

namespace tiefmu {

inline constexpr std::uint32_t noReference = ~0u;

// A known vector (or scalar, in column 0) and how it enters an unknown vector.
struct Entry {
  std::uint32_t known;  // reference of its first component; or, see acceleration(), a free node's acceleration
  Pattern pattern;
};
using List = std::vector<Entry>;

inline void add(List& to, Pattern pattern, std::uint32_t known) {
  if (known != noReference && !pattern.empty()) to.push_back({known, pattern});
}
inline void add(List& to, Pattern left, const List& from) {
  for (const Entry& e : from) add(to, left * e.pattern, e.known);
}

// The part of one corner in the motion of a slave, THEORY 2: v_s += vv v + vw w, w_s += wv v + ww w.
struct CornerMap {
  Pattern vv, vw, wv, ww;
};

struct Segment {
  const TieGroup& group;
  const int* node;
  int first, last;  // slaves
  Mat3 inverse;     // Ibar^-1 and arms at the start, where small displacements freeze them
  Vec3 arm[4];
};

class Influences {
 public:
  Influences(const Model& model, const Layout& layout, const std::vector<Block>& blocks);

  // Lists per node.
  std::vector<List> nodeForce, nodeMoment;          // springs and external loads on the node itself
  std::vector<List> reactionForce, reactionMoment;  // T^T f_s
  std::vector<List> inertialForce, inertialMoment;  // T^T M_s (T q'' + b) (consistent), D q'' (lumped)
  std::vector<List> addedMass, addedInertia;        // D
  // A pair of free nodes that the mass matrix couples (6 freedoms each, by blocks of 3).
  struct Pair { int node, other; CornerMap mass; };
  std::vector<Pair> coupled;

  // Calls body(segment) in the order of slaves.
  template <class Body>
  void eachSegment(Body body) const;
  void motion(const Segment& s, int slave, List& v, List& w, List& x) const;   // velocity, spin, position
  void acceleration(const Segment& s, int slave, List& a) const;               // T q'' + b

  // Numbers above all references stand for the freedoms of free nodes' accelerations, which are unknowns themselves:
  // 6 a node, translations first.
  std::uint32_t references() const { return references_; }

 private:
  std::uint32_t known(Field f, int index, int components = 3) const {
    const std::size_t at = static_cast<std::size_t>(index) * components;
    return at < layout[f].count ? referenceAt[layout[f].offset + at] : noReference;
  }
  bool isFree(int node) const { return node >= model.freeBegin() && node < model.freeEnd(); }
  std::uint32_t acceleration(int node) const {
    return isFree(node) ? references_ + 6 * static_cast<std::uint32_t>(node - model.freeBegin())
                        : known(Field::acceleration, node);
  }
  std::uint32_t angularAcceleration(int node) const {
    if (node >= model.rotating()) return noReference;
    return isFree(node) ? acceleration(node) + 3 : known(Field::angularAcceleration, node);
  }
  bool hasOffset(int slave) const { return !at(model.slaveOffset.data(), slave).isZero(0); }
  double weight(const Segment& s, int slave, int corner) const {
    return s.group.weight[static_cast<std::size_t>(slave - s.group.firstSlave) * s.group.corners + corner];
  }
  Segment segment(const TieGroup& group, int e) const;
  void corners(const Segment& s, int slave, CornerMap maps[4]) const;
  struct Bias { Pattern onV, onW, onZ; };
  Bias bias(const Segment& s, int slave, int corner) const;

  void findSprings();
  void addSpring(const Spring& spring, const std::vector<List>& v, const std::vector<List>& w,
                 const std::vector<List>& x);
  void findReactions();
  void findAdditions();
  void findInertialLoads();
  void addInertialLoads(const Segment& s);

  const Model& model;
  const Layout& layout;
  bool shapesChange = false;  // node positions are inputs that the segments' shapes follow
  std::uint32_t references_ = 0;
  std::vector<std::uint32_t> referenceAt;     // of each place in the array, where that is an input or a parameter
  std::vector<int> sprung;                    // per slave: its index in slaveForce, slaveMoment, or -1
  std::vector<List> slaveForce, slaveMoment;  // of springs, on sprung slaves
};

template <class Body>
void Influences::eachSegment(Body body) const {
  for (const TieGroup& g : model.groups)
    for (int e = 0; e < g.segments(); ++e) body(segment(g, e));
}

}  // namespace tiefmu
