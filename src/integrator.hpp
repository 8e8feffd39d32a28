// One explicit step of a simulation's free nodes (theory 6).
#pragma once

#include <vector>

#include "dynamics.hpp"

namespace tiefmu {

// [Noh & Bathe 2013], theory (6.6): the parameters that follow from the splitting ratio p.
namespace nohBathe {
constexpr double p = 0.54;
constexpr double q1 = (1 - 2 * p) / (2 * p * (1 - p));
constexpr double q2 = 0.5 - p * q1;
constexpr double q0 = -q1 - q2 + 0.5;
}  // namespace nohBathe

class Integrator {
 public:
  explicit Integrator(Dynamics& dynamics);

  // From t to t + h; `tau` is the time since the inputs were set, s. On entry the accelerations belong to the present
  // state and inputs. Returns whether they do so again on exit (central difference, Noh-Bathe) or must be evaluated
  // anew (symplectic Euler, RK4).
  bool step(double tau, double h);

 private:
  void rungeKutta(double tau, double h);
  double prediction(double h);  // beta of a central difference step

  Dynamics& dynamics_;
  std::vector<double> start_, rates_, sum_;  // of a Runge-Kutta step: the fields velocity .. work
  std::vector<double> earlier_;              // accelerations of a Noh-Bathe step's first point
};

}  // namespace tiefmu
