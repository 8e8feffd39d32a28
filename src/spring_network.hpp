// All springs of one simulation: their loads, stiffness and energy, and the rotations of the ends that need one.
#pragma once

#include <vector>

#include "attached_slaves.hpp"
#include "layout.hpp"
#include "spring.hpp"

namespace tiefmu {

// Loads on nodes and on slaves, as arrays that a call adds to: f (N) 3 per node, t (N m) 3 per rotating node; fs, ms
// likewise per slave and turning slave.
struct LoadArrays { double *f, *t, *fs, *ms; };

// A motion of nodes and of slaves, m, m/s and rad/s, arranged alike. x: null where no position changes.
struct MotionArrays { double *x, *v, *w, *xs, *vs, *ws; };

class SpringNetwork {
 public:
  SpringNetwork(const Model& model, const Layout& layout, double* data, AttachedSlaves& slaves);

  bool empty() const { return model_.springs.empty(); }

  // Adds the loads at the present positions, with the nodes' velocities v, w in the dampers. The attached slaves'
  // positions must be up to date.
  void addLoads(const double* v, const double* w, const LoadArrays& to);
  // Of the last addLoads.
  double strainEnergy() const { return strain_; }            // J
  double dissipation() const { return dissipation_; }        // W
  double largestTurnRate2() const { return turnRate2_; }     // of the springs' directions and ends, squared, (rad/s)^2
  void clear() { strain_ = dissipation_ = turnRate2_ = 0; }  // as without springs

  // Restoring loads K u (or damping C u) for a motion of the nodes: u 3 per node, turn 3 per rotating node; writes f, t
  // likewise. Includes T and T^T of the slaves.
  void applyTangent(const double* u, const double* turn, double* f, double* t, bool damping);
  // How addLoads at v, w and the strain energy (J) change with a motion of nodes and slaves. Adds to `loads` and
  // `strain`, or transposed to the motion.
  void differentiate(Way way, const double* v, const double* w, const MotionArrays& motion, const LoadArrays& loads,
                     double& strain);

  // The unit quaternion (w, x, y, z) that SpringEnd::orientation counts.
  const double* rotation(int index) const;
  // Field::orientation over a step h at the nodes' v, w, and its rate there, 1/s.
  void turnEnds(double h, const double* v, const double* w);
  void endRates(const double* v, const double* w, double* rate);

 private:
  EndMotion motion(const SpringEnd& end, const Spring& spring, const double* v, const double* w) const;
  Vec3 spin(const SpringEnd& end, const double* w) const;
  void addTo(const SpringEnd& end, const Vec3& force, const Vec3& moment, const LoadArrays& to) const;
  double* field(Field f) const { return data_ + layout_[f].offset; }

  const Model& model_;
  const Layout& layout_;
  double* data_;
  AttachedSlaves& slaves_;
  std::size_t segmentRotations_ = 0;              // quaternions of meanMotion segments
  std::vector<double> slaveForce_, slaveMoment_;  // of applyTangent
  double strain_ = 0, dissipation_ = 0, turnRate2_ = 0;
};

}  // namespace tiefmu
