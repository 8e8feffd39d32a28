// How long the next substep of a simulation may be (theory 6).
#pragma once

#include "dynamics.hpp"
#include "stability.hpp"

namespace tiefmu {

// Keeps the fields mode .. integratorLimit, stableTimeStep and nodalTimeStep.
class TimeStepLimit {
 public:
  explicit TimeStepLimit(Dynamics& dynamics) : d_(dynamics), spectrum_(dynamics) {}

  void compute();  // from the start; allocates
  // After a substep h, the `substeps`th: the highest frequency of the geometry as it has become, when it is due. No
  // allocation.
  void update(double h, std::int64_t substeps);

  double ofMethod() const { return *d_.field(Field::integratorLimit); }  // at which the integrator is still stable, s
  double ofStep() const;  // what a substep may take: that with safety, the time step asked for, the turn, s

 private:
  void refresh();
  void apply();  // the method's limit from the bounds of the frequencies

  Dynamics& d_;
  Spectrum spectrum_;
};

}  // namespace tiefmu
