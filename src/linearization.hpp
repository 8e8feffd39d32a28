// Derivatives of the outputs by the inputs: the way from inputs to outputs in loads.cpp, dynamics.cpp and outputs.cpp,
// linearised into a chain of maps. Directional derivatives run through it forward, adjoint ones backward by the
// transposes: J dx and J^T dy, each in one pass.
#pragma once

#include <functional>
#include <vector>

#include "dynamics.hpp"

namespace tiefmu {

class Linearization {
 public:
  explicit Linearization(Dynamics& dynamics);

  // `array` is laid out like the simulation's. On entry it holds a change of the inputs and else zeros, on return also
  // that of every output. Outputs must be up to date.
  void directional(double* array);
  // On entry it holds weights of the outputs and else zeros, on return also the gradient of the outputs' weighted sum
  // along each input. What else stands in the array is scratch.
  void adjoint(double* array);

 private:
  // One or more maps into the same places. Both ways they add to these; only `map`, forward, sets them: nothing has
  // been added before.
  using Link = std::function<void(Way)>;
  void then(Link link) { chain_.push_back(std::move(link)); }
  void chainLoads();
  void chainSlaveAccelerations(Field velocities, bool answered);
  void chainInertialLoads(Field velocities, bool answered, std::vector<double>& f, std::vector<double>& t);
  void startSlaveAccelerationsAnew();
  void chainAccelerations();
  void chainReactions();
  void chainOutputs();

  void start(double* array);
  void map(Way way, double* u, double* turn, const double* value, double* us, double* turns);
  void distribute(Way way, bool inertial, std::vector<double>& force, std::vector<double>& moment,
                  std::vector<double>& f, std::vector<double>& t);
  void distributeByFrames(Way way, const double* force, const double* moment, double* f);
  void gather(Way way, std::vector<double>& f, std::vector<double>& t);
  void differentiateEnergies(Way way);
  void differentiatePower(Way way);

  double* of(Field f) const { return array_ + d_.layout[f].offset; }
  // Of the nodes, for the bias: Field::velocity or Field::predicted.
  const double* velocityOf(Field f) const { return d_.velocityFor(f); }
  const double* spinOf(Field f) const { return f == Field::velocity ? d_.field(Field::spin) : d_.spinFor(f); }
  // Of the nodes: those that the reactions answer to, or the present ones.
  Dynamics::Accelerations accelerations(bool answered) const {
    if (answered) return d_.answered();
    return {d_.field(Field::acceleration), d_.field(Field::angularAcceleration)};
  }
  // Are the nodes' positions inputs, and do the frames of segments follow them?
  bool placesMove() const { return d_.has(Field::position) && !d_.positionsIntegrated(); }
  bool framesMove() const { return placesMove() && d_.model.finite(); }
  double* dx() const { return placesMove() ? of(Field::position) : nullptr; }

  Dynamics& d_;
  std::vector<Link> chain_;
  double* array_ = nullptr;
  double strain_ = 0;  // of the strain energy
  // Of slaves' positions and velocities; their loads f_s; loads on nodes; slaves' accelerations; reactions; the right
  // side of the free nodes' equation of motion.
  std::vector<double> xs_, vs_, ws_, load_, moment_, nodeLoad_, nodeMoment_, as_, zs_, f_, t_, right_, rightMoment_;
  std::vector<double> slaves_, turningSlaves_, nodes_, rotatingNodes_;  // scratch of a link
  std::vector<double> still_, stillTurn_, stillTurnOfNodes_;            // stay zero
};

}  // namespace tiefmu
