// How known vectors (inputs, parameters) enter the vectors that the model computes, before any equation is solved.
#pragma once

#include <array>
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

// The part of one corner in the motion of a slave, theory 2: v_s += vv v + vw w, w_s += wv v + ww w.
struct CornerMap { Pattern vv, vw, wv, ww; };

// Bodies are the independent nodes and, numbered on from there, the ports of driven nodes. A segment whose corners all
// belong to one port rides on that body alone.
struct Segment {
  const TieGroup& group;
  const int* node;  // corners
  int first, last;  // slaves
  int bodies;       // that move it: its corners, or one port
  int body[4];
  Mat3 inverse;  // Ibar^-1 and arms at the start, where small displacements freeze them
  Vec3 arm[4];
};

class Influences {
 public:
  Influences(const Model& model, const Layout& layout, const std::vector<Block>& blocks);

  // Lists per body; those of ports hold the sums over their nodes.
  std::vector<List> nodeForce, nodeMoment;          // springs and external loads on the node itself
  std::vector<List> reactionForce, reactionMoment;  // T^T f_s
  std::vector<List> inertialForce, inertialMoment;  // T^T M_s (T q'' + b) (consistent), D q'' (lumped)
  std::vector<List> addedMass, addedInertia;        // D, per node
  struct Resultant { List force, moment; };
  Resultant resultant(std::size_t port, bool inertial) const;  // of everything on a port of driven nodes
  std::vector<Resultant> means;                                // velocity and spin of the ports of slaves
  // A pair of free nodes that the mass matrix couples (6 freedoms each, by blocks of 3).
  struct Pair {
    int node, other;
    CornerMap mass;
  };
  std::vector<Pair> coupled;

  // Calls body(segment) in the order of slaves.
  template <class Body> void eachSegment(Body body) const;
  struct Motion { List velocity, spin, position; };
  Motion motion(const Segment& s, int slave) const;
  List acceleration(const Segment& s, int slave) const;  // T q'' + b

  // Numbers above all references stand for the freedoms of free nodes' accelerations, which are unknowns themselves:
  // 6 a node, translations first.
  std::uint32_t references() const { return references_; }

 private:
  std::uint32_t known(Field f, int index, int components = 3) const {
    const std::size_t at = static_cast<std::size_t>(index) * components;
    return at < layout[f].count ? referenceAt[layout[f].offset + at] : noReference;
  }
  std::size_t portOf(int body) const {
    if (body >= model.nodes()) return static_cast<std::size_t>(body - model.nodes());
    return nodePort.empty() ? none : nodePort[static_cast<std::size_t>(body)].port;
  }
  bool isFree(int node) const { return node >= model.freeBegin() && node < model.freeEnd(); }
  // A body's motion into a list, each through a pattern.
  void addVelocity(List& to, Pattern left, int body) const;
  void addSpin(List& to, Pattern left, int body) const;
  void addAcceleration(List& to, Pattern left, int body) const;
  void addAngularAcceleration(List& to, Pattern left, int body) const;
  Pattern turning(const Vec3& arm) const;
  std::array<Pattern, 3> asOne(std::size_t port) const;
  Pattern armOf(int node) const;                                 // of w in v + w x r of a port's node
  CornerMap portMap(std::size_t port, std::size_t index) const;  // the part of one slave in the port's mean motion
  bool hasOffset(int slave) const { return !at(model.slaveOffset.data(), slave).isZero(0); }
  double weight(const Segment& s, int slave, int corner) const {
    return s.group.weight[static_cast<std::size_t>(slave - s.group.firstSlave) * s.group.corners + corner];
  }
  Segment segment(const TieGroup& group, int e) const;
  void corners(const Segment& s, int slave, CornerMap maps[4]) const;
  struct Bias { Pattern onV, onW, onZ; };
  Bias bias(const Segment& s, int slave, int corner) const;

  void findMembers();
  void findSprings();
  void addSpring(const Spring& spring, const std::vector<Motion>& ends);
  void addPortLoads(int slave, List& force, List& moment) const;
  void findReactions();
  void findAdditions();
  void findInertialLoads();
  void findMeans();
  void addInertialLoads(const Segment& s);

  const Model& model;
  const Layout& layout;
  static constexpr std::size_t none = ~std::size_t{0};
  struct Membership { std::size_t port = none, index = 0; };
  std::vector<Membership> nodePort, slavePort;  // empty where there are no such ports
  struct SlavePort {
    int body;      // a port of driven nodes that alone moves all of them, or -1
    bool rigid;    // and as parts of itself
    Mat3 inverse;  // J^-1 at the start, see src/port.hpp
  };
  std::vector<SlavePort> slavePorts;
  bool shapesChange = false;  // node positions are inputs that the segments' shapes follow
  std::uint32_t references_ = 0;
  std::vector<std::uint32_t> referenceAt;     // of each place in the array, where that is an input or a parameter
  std::vector<int> sprung;                    // per slave: its index in slaveForce, slaveMoment, or -1
  std::vector<List> slaveForce, slaveMoment;  // of springs, on sprung slaves
};

template <class Body> void Influences::eachSegment(Body body) const {
  for (const TieGroup& g : model.groups)
    for (int e = 0; e < g.segments(); ++e) body(segment(g, e));
}

}  // namespace tiefmu
