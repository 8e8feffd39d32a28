// What moves the state on: kicks, drifts, rates for Runge-Kutta, and inputs that move inside a step.
#include <algorithm>

#include "dynamics.hpp"

namespace tiefmu {

// value += h rate
void Dynamics::advance(std::size_t count, double h, const double* rate, double* value) {
  if (count == 0) return;
  ties.eachBlock(count,
                 [&](std::size_t first, std::size_t last) { addScaled(last - first, h, rate + first, value + first); });
}

void Dynamics::kick(double h) {
  const double *a = field(Field::acceleration), *z = field(Field::angularAcceleration);
  double *v = field(Field::velocity), *w = field(Field::spin);
  const int first = 3 * model.freeBegin();
  advance(3 * model.free(), h, a + first, v + first);
  advance(3 * model.rotating() - first, h, z + first, w + first);
}

void Dynamics::drift(double h, double ahead) {
  const double *v = field(Field::velocity), *w = field(Field::spin);
  if (ahead != 0) {
    std::copy_n(v, step_.size(), step_.begin());
    std::copy_n(w, stepSpin_.size(), stepSpin_.begin());
    const double *a = field(Field::acceleration), *z = field(Field::angularAcceleration);
    for (int i = 3 * model.freeBegin(); i < 3 * model.freeEnd(); ++i) step_[i] += ahead * a[i];
    for (int i = 3 * model.freeBegin(); i < 3 * model.rotating(); ++i) stepSpin_[i] += ahead * z[i];
    v = step_.data();
    w = stepSpin_.data();
  }
  if (has(Field::orientation)) springs.turnEnds(h, v, w);
  ties.move(h, v, w);
  advance(layout[Field::angle].count, h, w, field(Field::angle));
  if (!has(Field::position)) return;
  double* x = field(Field::position);
  if (positionsIntegrated_) {
    advance(3 * model.nodes(), h, v, x);
  } else {  // driven positions that are inputs stay as they were set
    advance(3 * model.free(), h, v + 3 * model.freeBegin(), x + 3 * model.freeBegin());
    ties.updateGeometry();
  }
}

void Dynamics::rates(double* rate) {
  std::fill_n(rate, layout.through(Field::velocity, Field::work).count, 0.0);
  const auto of = [&](Field f) { return rate + (layout[f].offset - layout[Field::velocity].offset); };
  const double *v = field(Field::velocity), *w = field(Field::spin);
  const double *a = field(Field::acceleration), *z = field(Field::angularAcceleration);
  std::copy(a + 3 * model.freeBegin(), a + 3 * model.freeEnd(), of(Field::velocity) + 3 * model.freeBegin());
  std::copy(z + 3 * model.freeBegin(), z + 3 * model.rotating(), of(Field::spin) + 3 * model.freeBegin());
  if (has(Field::position)) {
    if (positionsIntegrated_)
      std::copy_n(v, layout[Field::position].count, of(Field::position));
    else
      std::copy(v + 3 * model.freeBegin(), v + 3 * model.freeEnd(), of(Field::position) + 3 * model.freeBegin());
  }
  std::copy_n(w, layout[Field::angle].count, of(Field::angle));
  ties.rates(v, w, of(Field::offset), of(Field::segmentRotation));
  if (has(Field::orientation)) springs.endRates(v, w, of(Field::orientation));
  if (has(Field::work)) {
    const Power p = power();
    of(Field::work)[Work::external] = p.external;
    of(Field::work)[Work::dissipated] = p.dissipated;
  }
}

void Dynamics::normalise() {
  for (Field f : {Field::segmentRotation, Field::orientation})
    for (std::size_t k = 0; k < layout[f].count; k += 4) Eigen::Map<Eigen::Vector4d>(field(f) + k).normalize();
  ties.normaliseOffsets();
}

void Dynamics::inputsOver(double tau, double h) {
  if (inputs.active()) inputs.over(tau, h, data);
  if (ports.anyDriven()) ports.carry(inputs, tau, h);
}

void Dynamics::inputsAt(double tau, double h) {
  if (inputs.active()) {
    inputs.at(tau + h, data);
    if (!positionsIntegrated_) ties.updateGeometry();
  }
  if (ports.anyDriven()) ports.advance(inputs, tau, h);
}

void Dynamics::movePorts() {
  ports.move();
  takeDrivenVelocities();
}

}  // namespace tiefmu
