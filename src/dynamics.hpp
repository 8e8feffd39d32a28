// The equations of motion of one simulation: loads to accelerations, and what moves the state on.
#pragma once

#include <memory>
#include <vector>

#include "attached_slaves.hpp"
#include "inertia.hpp"
#include "inertia_islands.hpp"
#include "input_curve.hpp"
#include "layout.hpp"
#include "loads.hpp"
#include "port.hpp"
#include "spring_network.hpp"
#include "ties.hpp"

namespace tiefmu {

// Works on the array `data` laid out by `layout`; holds only scratch beside it, so that a copy of the array is the
// whole state. No function but the constructor and `prepare` allocates.
class Dynamics {
 public:
  Dynamics(const Model& model, const Layout& layout, double* data);

  const Model& model;
  const Layout& layout;
  double* data;
  double* field(Field f) { return data + layout[f].offset; }
  bool has(Field f) const { return layout[f].count > 0; }

  Ties ties;
  AttachedSlaves attached;
  SpringNetwork springs;
  Ports ports;
  Loads loads;
  InputCurve inputs;  // inputs that move inside the step

  void setStart();     // every field to its start value
  void prepare();      // from the parameters: added inertia, stiffness, then prepareMass. Throws SceneError
  void prepareMass();  // what stands beside the array: geometry and mass matrix. Throws SceneError

  // --- forces and accelerations (dynamics.cpp)
  // Loads at the present geometry with `lagged` velocities in the dampers, what of them the tie passes on to the nodes,
  // and the free nodes' accelerations, with `predicted` velocities in the bias.
  void evaluate();
  void evaluateLoads();   // the same without the accelerations
  void bringReactions();  // tieForce where `evaluate` needs no such sums and leaves them out
  void updateMass();      // the mass matrix at the present geometry, as `evaluate` does. Throws SceneError
  // T^T f_s of the last evaluation: N, 3 per node, and N m, 3 per rotating node.
  const double* tieForce() const { return tieForce_; }
  const double* tieMoment() const { return tieMoment_; }
  // Slaves' accelerations T q'' + b (m/s2, rad/s2), kept until the next call; then in their place the loads
  // -m_s a_s, -I_s z_s of their inertia (N, N m).
  void updateSlaveAccelerations(const double* a, const double* z, const double* v, const double* w);
  void turnIntoInertialLoads() { turnIntoInertialLoads(as_.data(), zs_.data()); }
  void turnIntoInertialLoads(double* as, double* zs);  // the same with any such arrays
  // What the reactions answer to: the nodes' accelerations, ahead of the present ones where the scene says so, theory
  // (5.11). Until the next call.
  struct Accelerations { const double *linear, *angular; };
  Accelerations answered();
  // At the end of a step: the driven nodes' accelerations in it. `before`: there was one before it.
  void holdAccelerations(bool before);
  std::vector<double>& slaveAcceleration() { return as_; }
  std::vector<double>& slaveAngularAcceleration() { return zs_; }
  // M^-1 of the free nodes, on node arrays: loads f, t to accelerations a, z.
  void solveInertia(const double* f, const double* t, double* a, double* z);
  // How fast the geometry of the last `evaluate` turns, rad/s: springs and what holds them (which changes the
  // stiffness), and with consistent inertia every tie (whose bias is explicit).
  double turnRate() const { return turnRate_; }
  bool hasBias() const { return ties.hasBias() && islands_; }
  // Velocities (3 per node) and spins (3 per rotating node) that the dampers and the bias see.
  const double* velocityFor(Field f) { return has(f) ? field(f) : field(Field::velocity); }
  const double* spinFor(Field f) { return has(f) ? field(f) + 3 * model.nodes() : field(Field::spin); }
  // Where an iteration for the accelerations starts, and what it learns for the next time. What was evaluated between
  // two steps does not count but for the last time, so that the answer to new inputs does not depend on those tried
  // before.
  void rememberJump();        // at the start of a step, of the solution there
  void guessAccelerations();  // for the end of a substep: the present ones and their increment over the last one
  void rememberIncrement();   // at the end of a substep, of the solution there
  // Sets `lagged` and `predicted`, where this model has them, from velocity and spin plus so many seconds of the
  // accelerations.
  void setForceVelocities(double aheadOfLagged, double aheadOfPredicted);
  void takeDrivenVelocities();  // the driven part of the same, after inputs have changed

  // --- motion (dynamics_motion.cpp)
  // v += h a over the free nodes.
  void kick(double h);
  // Positions and rotations over h with velocity + ahead * acceleration (free nodes), then the geometry.
  void drift(double h, double ahead);
  // d/dt of the fields velocity .. work at the present state, for a Runge-Kutta stage. `rates` starts at velocity.
  void rates(double* rates);
  void normalise();  // offsets and rotations back to their length after a Runge-Kutta step
  // Inputs and ports that move inside the step; no-ops where none does. Before a drift from tau to tau + h the
  // inputs' mean over it, after it their end.
  void inputsOver(double tau, double h);
  void inputsAt(double tau, double h);
  void movePorts();  // the ports' nodes, after inputs have changed

  // --- energy (dynamics_energy.cpp)
  // Power into the system from loads, gravity and driven nodes, and that lost in dampers, W.
  struct Power { double external, dissipated; };
  Power power();
  double kineticEnergy();  // J
  double strainEnergy() const { return springs.strainEnergy(); }

  const ConsistentInertia* inertia() const { return inertia_.get(); }
  bool positionsIntegrated() const { return positionsIntegrated_; }  // of driven nodes; else they are inputs

  std::int64_t evaluations = 0;

 private:
  void gatherLoads();
  void sumReactions();
  SegmentLoads loadsOnSegments();
  const double* segmentRotations() {
    return model.finite() && has(Field::segmentRotation) ? field(Field::segmentRotation) : nullptr;
  }
  void turnIntoLoads(const double* force, const double* moment);
  void solveIslands(double* a, double* z);
  void leaveLoads();
  void iterate(double* a, double* z);
  template <class Body> void eachFree(Body body);
  void updateInertia();
  void updateTurnRate(const double* v, const double* w);
  void advance(std::size_t count, double h, const double* rate, double* value);

  double *tieForce_ = nullptr, *tieMoment_ = nullptr;
  std::vector<double> tieForceScratch_, tieMomentScratch_;  // where reactionForce is more than T^T f_s
  std::vector<double> as_, zs_;                             // slaves' accelerations, or the loads of their inertia
  std::vector<double> vs_, ws_;                             // slaves' velocities, for energies
  std::vector<double> ahead_;                               // answered(): of the nodes, then of the rotating ones
  std::vector<double> right_, rightMoment_;                 // right side of the mass matrix
  std::vector<double> step_, stepSpin_;                     // velocities of a drift
  double turnRate_ = 0;
  std::int64_t massOf_ = -1;  // Ties::changes() that the mass matrix belongs to
  bool knownAccelerations_ = false, positionsIntegrated_ = true, sumsReactions_ = true;
  std::unique_ptr<Islands> islands_;            // consistent inertia: segments by themselves,
  std::unique_ptr<ConsistentInertia> inertia_;  // and the rest; null: nothing is left
};

}  // namespace tiefmu
