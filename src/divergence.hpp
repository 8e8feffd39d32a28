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
  void checkPorts(double time, double h) {  // also: do those of slaves still have a rotation?
    if (!d_.model.ports.empty()) checkEachPort(time, h);
  }
  void checkSegments(double time) {  // has one collapsed?
    if (d_.model.finite() && d_.ties.someCollapsed()) checkEachSegment(time);
  }

 private:
  bool allWithin(std::size_t count, const double* value, double limit);
  // What is not within it: throws.
  void findVelocity(Field f, int last, double time, double limit) const;
  void findPosition(const double* x, const double* v, std::size_t count, double time, double h) const;
  void checkEachPort(double time, double h);
  void checkEachSegment(double time);

  Dynamics& d_;
};

}  // namespace tiefmu
