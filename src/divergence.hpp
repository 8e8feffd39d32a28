// Whether a solution is still one. Every check throws Diverged with one line that says what has gone where.
#pragma once

#include "dynamics.hpp"

namespace tiefmu {

class DivergenceChecks {
 public:
  explicit DivergenceChecks(Dynamics& dynamics) : d_(dynamics) {}

  // `time`: for the message, s. `limit`: of the time step, for the message, s.
  void checkVelocities(double time, double limit);  // of free nodes
  // Positions of all nodes, ports of driven nodes: after h more at the present velocities (0: as they stand).
  void checkPositions(double time, double h);
  void checkPorts(double time, double h);  // also: do those of slaves still have a rotation?
  void checkSegments(double time);         // has one collapsed?

 private:
  bool allWithin(std::size_t count, const double* value, double limit);

  Dynamics& d_;
};

}  // namespace tiefmu
