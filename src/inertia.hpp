// The inertia that accelerates the free nodes (THEORY 4): lumped additions, or the consistent mass matrix.
#pragma once

#include <vector>

#include "model.hpp"
#include "tie.hpp"

namespace tiefmu {

// D_i of every node: mass (kg) per node and inertia (kg m2) per rotating node. [seed (1), (2), (7), (8)]
void lumpedAdditions(const Model& model, const double* slaveMass, const double* slaveInertia, double* mass,
                     double* inertia);

// Nodal stiffness K_i (N/m) and Kr_i (N m/rad): declared, plus the springs', plus the slaves' shares. [seed (3)]
void nodalStiffness(const Model& model, double* translation, double* rotation);

// The matrix M_m + T^T M_s T of the free nodes, and solutions with it.
//
// Unknowns are 3-vectors: the free nodes' accelerations, then the angular accelerations of those that rotate. Where no
// slave turns the three components part and the matrix is scalar, one row a node. A constant matrix is factored once, a
// small one at every geometry; a large one that changes is solved by conjugate gradients with its diagonal blocks as
// preconditioner. The solution is a function of geometry, right side and guess alone, so that a restored state
// continues with the same bits.
class ConsistentInertia {
 public:
  explicit ConsistentInertia(const Model& model);

  // Does the matrix stay as it is at the start? (Small displacements, or no offset that turns.)
  bool constant() const { return constant_; }
  // Values at this geometry, and the factor where one is used. Throws SceneError naming a node without inertia.
  void update(const double* nodeMass, const double* nodeInertia, const double* slaveMass, const double* slaveInertia,
              const double* offset, const std::vector<SegmentFrame>& frames);
  // Right sides `force` (3 per free node, N) and `moment` (3 per free rotating node, N m) to accelerations; `a`, `z`
  // hold a guess on entry.
  void solve(const double* force, const double* moment, double* a, double* z);
  // (force, moment) = M (a, z)
  void multiply(const double* a, const double* z, double* force, double* moment);

 private:
  void findPattern();
  void findFactorPattern();
  void addBlock(int slot, const Mat3& block);
  void addSegments(const TieGroup& group, const std::vector<int>& slots, const double* slaveMass,
                   const double* slaveInertia, const double* offset, const SegmentFrame* frame);
  bool factor();
  void substitute(double* x) const;
  void conjugateGradients();
  void product(const double* x, double* y) const;

  const Model& model_;
  int free_, freeRotating_, unknowns_, width_;  // width_: 3, or 1 where components part
  bool constant_, direct_;
  std::vector<int> position_;                   // unknown -> place in the factor's order
  std::vector<int> columnBegin_, row_;          // upper triangle of blocks, by columns, in that order
  std::vector<double> value_;                   // width_ squared per block, column by column
  std::vector<std::vector<int>> slots_;         // per group: 2 * block + transposed for each pair of a segment, or -1
  std::vector<int> parent_, factorBegin_, factorRow_, count_, flag_, stack_;
  std::vector<double> factorValue_, pivot_, row1_;  // L D L^T
  std::vector<double> x_, rhs_, residual_, direction_, image_, preconditioned_, diagonal_;
};

}  // namespace tiefmu
