// The inertia that accelerates the free nodes (theory 4): lumped additions, or the consistent mass matrix.
#pragma once

#include <memory>
#include <vector>

#include "model.hpp"
#include "tie.hpp"

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

// The matrix M_m + T^T M_s T of the free nodes, and solutions with it. A solution is a function of geometry, right side
// and guess alone, so that a restored state continues with the same bits.
class ConsistentInertia {
 public:
  // Factored where the system is small, or constant and one number a node; solved by conjugate gradients else.
  static std::unique_ptr<ConsistentInertia> of(const Model& model);
  virtual ~ConsistentInertia() = default;

  // Does the matrix stay as it is at the start? (Small displacements, or no offset that turns.)
  bool constant() const { return constant_; }
  // Values at this geometry, and the factor where one is used. Throws SceneError naming a node without inertia.
  virtual void update(const double* nodeMass, const double* nodeInertia, const double* slaveMass,
                      const double* slaveInertia, const double* offset, const std::vector<SegmentFrame>& frames) = 0;
  // Right sides `force` (3 per free node, N) and `moment` (3 per free rotating node, N m) to accelerations; `a`, `z`
  // hold a guess on entry. An iteration ends when the residual is solutionTolerance of the right side, both in a norm
  // like that of the inverse matrix.
  virtual void solve(const double* force, const double* moment, double* a, double* z) = 0;

  static constexpr double solutionTolerance = 1e-12;

 protected:
  explicit ConsistentInertia(const Model& model);
  [[noreturn]] void refuse(int freeNode, bool turn) const;

  const Model& model_;
  int free_, freeRotating_;
  bool constant_;
};

}  // namespace tiefmu
