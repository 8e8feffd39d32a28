// The outputs of one simulation, computed from its state and the last evaluation of its loads.
#pragma once

#include "dynamics.hpp"

namespace tiefmu {

class Outputs {
 public:
  explicit Outputs(Dynamics& dynamics) : d_(dynamics) {}

  // Every output field at the present state. `evaluate` (or evaluateLoads) must be up to date. No allocation.
  void update();

 private:
  void updateReactions();
  void updatePorts();
  void updateEnergies();
  double powerResidual() const;
  double drift() const;
  double* field(Field f) const { return d_.field(f); }

  Dynamics& d_;
};

}  // namespace tiefmu
