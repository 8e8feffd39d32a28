// Directional derivatives of the outputs: the way from inputs to outputs in loads.cpp, dynamics.cpp and outputs.cpp,
// differentiated.
#pragma once

#include <vector>

#include "dynamics.hpp"

namespace tiefmu {

class DirectionalDerivative {
 public:
  explicit DirectionalDerivative(Dynamics& dynamics);

  // `derivative` is laid out like the array; on entry it holds a change of the inputs, on return also that of every
  // output. Outputs must be up to date.
  void evaluate(double* derivative);

 private:
  void differentiateLoads();
  void differentiateAccelerations(const double* da, const double* dz, const double* v, const double* w);
  void evaluateAccelerations();
  void differentiateOutputs();
  void differentiateReactions();
  void differentiateEnergies();
  void distribute(const std::vector<double>& force, const std::vector<double>& moment, const double* value,
                  const double* valueMoment);
  double* of(Field f) const { return derivative_ + d_.layout[f].offset; }  // derivative of a field
  const double* accelerations() const { return d_.has(Field::acceleration) ? d_.field(Field::acceleration) : nullptr; }
  // Of the nodes' positions: where they are inputs, else null.
  const double* dx() const;
  const double* dxOfFrames() const { return d_.model.finite() ? dx() : nullptr; }

  Dynamics& d_;
  double* derivative_ = nullptr;
  double strain_ = 0;  // of the strain energy
  // Derivatives: of slaves' positions and velocities; their loads f_s; loads on nodes; slaves' accelerations, or the
  // loads of their inertia; reactions.
  std::vector<double> xs_, vs_, ws_, load_, moment_, nodeLoad_, nodeMoment_, as_, zs_, f_, t_;
  std::vector<double> v_, w_, bias_, biasTurn_, zero_, keptForce_, keptMoment_;  // scratch
};

}  // namespace tiefmu
