#include "integrator.hpp"

#include <algorithm>

#include "stability.hpp"

namespace tiefmu {

Integrator::Integrator(Dynamics& dynamics) : dynamics_(dynamics) {
  const Layout& layout = dynamics.layout;
  if (dynamics.model.settings.method == Method::rk4) {
    start_.resize(layout.through(Field::velocity, Field::work).count);
    rates_.resize(start_.size());
    sum_.resize(start_.size());
  }
  if (dynamics.model.settings.method == Method::nohBathe)
    earlier_.resize(layout.through(Field::acceleration, Field::angularAcceleration).count);
}

bool Integrator::step(double tau, double h) {
  Dynamics& d = dynamics_;
  switch (d.model.settings.method) {
    case Method::centralDifference:
      // Half kick, drift, half kick. Dampers and the bias see the half-step velocity extrapolated to the end of the
      // step, without which the order would drop to one; dampers only as far as the step stays stable.
      d.rememberJump();
      d.kick(0.5 * h);
      d.inputsOver(tau, h);
      d.drift(h, 0);
      d.inputsAt(tau, h);
      d.setForceVelocities(0.5 * h * prediction(h), 0.5 * h);
      d.guessAccelerations();
      d.evaluate();
      d.rememberIncrement();
      d.kick(0.5 * h);
      return true;
    case Method::symplecticEuler:
      d.kick(h);
      d.inputsOver(tau, h);
      d.drift(h, 0);
      d.inputsAt(tau, h);
      d.setForceVelocities(0, 0);
      d.rememberIncrement();
      d.guessAccelerations();
      return false;
    case Method::nohBathe: {
      const double h1 = nohBathe::p * h, h2 = (1 - nohBathe::p) * h;
      static_assert(adjacent(Field::acceleration, Field::angularAcceleration));
      double* a = d.field(Field::acceleration);  // both
      d.rememberJump();
      d.inputsOver(tau, h1);
      d.drift(h1, 0.5 * h1);
      d.inputsAt(tau, h1);
      d.setForceVelocities(h1, h1);
      d.kick(0.5 * h1);
      std::copy_n(a, earlier_.size(), earlier_.begin());
      d.guessAccelerations();
      d.evaluate();
      d.rememberIncrement();
      d.kick(0.5 * h1);
      d.inputsOver(tau + h1, h2);
      d.drift(h2, 0.5 * h2);
      d.inputsAt(tau + h1, h2);
      d.setForceVelocities(h2, h2);
      // v += h2 (q0 a_0 + (1/2 + q1) a_1 + q2 a_2)
      d.kick((0.5 + nohBathe::q1) * h2);
      std::swap_ranges(earlier_.begin(), earlier_.end(), a);
      d.kick(nohBathe::q0 * h2);
      std::swap_ranges(earlier_.begin(), earlier_.end(), a);
      d.guessAccelerations();
      d.evaluate();
      d.rememberIncrement();
      d.kick(nohBathe::q2 * h2);
      return true;
    }
    case Method::rk4: rungeKutta(tau, h); return false;
  }
  return false;
}

// Half of the margin that the safety factor keeps is left to what changes between two looks at the highest frequency.
double Integrator::prediction(double h) {
  const double safety = std::min(1.0, *dynamics_.field(Field::safety));
  return damperPrediction(2 / (1 + safety) * h, *dynamics_.field(Field::highestFrequency),
                          *dynamics_.field(Field::dampingRate));
}

void Integrator::rungeKutta(double tau, double h) {
  Dynamics& d = dynamics_;
  static_assert(allAre(Field::velocity, Field::work, Role::motion, Role::state));
  double* y = d.field(Field::velocity);  // through work
  const std::size_t size = start_.size();
  std::copy_n(y, size, start_.begin());
  static constexpr double ahead[] = {0.5, 0.5, 1}, weight[] = {1, 2, 2, 1};
  for (int stage = 0; stage < 4; ++stage) {
    if (stage > 0) {
      for (std::size_t k = 0; k < size; ++k) y[k] = start_[k] + ahead[stage - 1] * h * rates_[k];
      d.inputsAt(tau, ahead[stage - 1] * h);
      d.ties.updateGeometry();
      d.setForceVelocities(0, 0);
      d.guessAccelerations();
      d.evaluate();
    }
    d.rates(rates_.data());
    if (stage == 0)
      std::copy(rates_.begin(), rates_.end(), sum_.begin());
    else
      for (std::size_t k = 0; k < size; ++k) sum_[k] += weight[stage] * rates_[k];
  }
  for (std::size_t k = 0; k < size; ++k) y[k] = start_[k] + h / 6 * sum_[k];
  d.inputsAt(tau, h);
  d.normalise();
  d.ties.updateGeometry();
  d.setForceVelocities(0, 0);
  d.guessAccelerations();
}

}  // namespace tiefmu
