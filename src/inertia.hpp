// The inertia that accelerates the free nodes (theory 4): lumped additions, or the consistent mass matrix.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "model.hpp"
#include "segment_solve.hpp"
#include "ties.hpp"

namespace tiefmu {

// D_i of every node: mass (kg) per node and inertia (kg m2) per rotating node. [theory (4.1), (4.2)]
void lumpedAdditions(const Model& model, const double* slaveMass, const double* slaveInertia, double* mass,
                     double* inertia);

// The same apart for each slave and corner of its segment: four masses and inertias a slave, 0 where a triangle has no
// fourth corner. [theory (4.1), (4.2)]
void lumpedAdditionsBySlave(const Model& model, const double* slaveMass, const double* slaveInertia, double* mass,
                            double* inertia);

// Nodal stiffness K_i (N/m) and Kr_i (N m/rad): declared, plus the springs', plus the slaves' shares. [theory (6.1),
// (6.2)]
void nodalStiffness(const Model& model, double* translation, double* rotation);

// The slaves of a segment as one body that turns about the point that their offsets start from.
struct SlaveBody {
  double mass;                    // kg
  Vec3 moment;                    // sum m d, kg m
  std::array<double, 6> inertia;  // sum m (d^2 1 - d d^T) + I 1: xx xy xz yy yz zz, kg m2
};
SlaveBody slaveBody(const Model& model, const TieGroup& group, int segment, const double* slaveMass,
                    const double* slaveInertia);  // at the start

// What the mass matrix follows from.
struct InertiaGeometry {
  const Ties& ties;
  const double *slaveMass, *slaveInertia;  // kg, kg m2
  const double* offset;                    // 3 per turning slave, m
  const double* rotation;                  // of meanMotion segments, a unit quaternion each; null: not turned
};

// A direction in which the solution may lie, and its energy d . M d, about; 0: none.
struct Along {
  double energy = 0;
  const double *a = nullptr, *z = nullptr;  // 3 per node (rotating node)
};
// What an iteration has done to its guess: r . B r before it, with B the inverse of the nodes' own blocks of M, and the
// energy of the change.
struct Correction { double residual = 0, energy = 0; };

// The matrix M_m + T^T M_s T of free nodes that share segments, and solutions with it. A solution is a function of
// geometry, right side and guess alone, so that a restored state continues with the same bits.
class ConsistentInertia {
 public:
  // Of these free nodes (ascending, from 0), all other corners of whose segments are not free. Factored where it is one
  // number a node and small or wanted to many digits, and where it is small with nodes that have no inertia of their
  // own; solved by conjugate gradients else.
  static std::unique_ptr<ConsistentInertia> of(const Model& model, const std::vector<int>& nodes);
  static bool iterates(const Model& model, const std::vector<int>& nodes);  // is it solved by conjugate gradients?
  static constexpr int smallSystem = 40;  // unknowns, 3-vectors: up to so many are solved to rounding
  virtual ~ConsistentInertia() = default;

  // Does the matrix stay as it is at the start? (Small displacements, or no offset that turns.)
  bool constant() const { return constant_; }
  virtual void prepare(const double* slaveMass, const double* slaveInertia) = 0;  // before `update`, once
  // Values at this geometry, and the factor where one is used. Throws SceneError naming a node without inertia.
  virtual void update(const InertiaGeometry& geometry) = 0;
  // Accelerations `a`, `z` of the matrix's nodes from right sides `force`, `moment`: 3 per node (rotating node), N, N
  // m. An iteration ends when the residual is `tolerance` of the right side, theory (4.7).
  virtual void solve(const Ties& ties, double tolerance, const double* force, const double* moment, double* a,
                     double* z) = 0;
  // The same for loads on nodes and slaves and the bias, where an iteration does it. First what these and the slaves'
  // inertia leave with the guess `a`, `z`; returns the largest |w|^2 of a slave, (rad/s)^2.
  virtual double leave(const Ties&, const SegmentLoads&, const double* /*offset*/, const double* /*a*/,
                       const double* /*z*/) {
    return 0;
  }
  // Then whether the guess is better than none, and at last what it lacks.
  virtual bool start(const Ties&, const Along&) { return true; }
  virtual Correction finish(const Ties&, double /*tolerance*/, double* /*a*/, double* /*z*/) { return {}; }

 protected:
  ConsistentInertia(const Model& model, const std::vector<int>& nodes);
  [[noreturn]] void refuse(int number, bool turn) const;
  // Number of an independent node among the matrix's, or -1.
  int numberOf(int node) const {
    const int i = node - model_.freeBegin();
    return i >= 0 && i < model_.free() ? number_[i] : -1;
  }

  const Model& model_;
  std::vector<int> node_;    // free nodes from 0; those that rotate come first
  std::vector<int> number_;  // of each free node in node_, or -1
  int free_, freeRotating_;  // how many nodes, and how many of them rotate
  bool constant_, turning_, meanMotion_;
};

}  // namespace tiefmu
