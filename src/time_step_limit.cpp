#include "time_step_limit.hpp"

#include <algorithm>
#include <cmath>

namespace tiefmu {
namespace {

constexpr int refreshEvery = 100;     // substeps between two looks at the highest frequency, at most
constexpr double refreshTurn = 0.1;   // rad that the geometry turns between them, at most
constexpr double largestTurn = 0.25;  // rad a substep, where the bias of consistent inertia is explicit
constexpr double none = 1e30;

}  // namespace

double TimeStepLimit::ofStep() const {
  const double limit = *d_.field(Field::safety) * ofMethod();
  const double asked = *d_.field(Field::timeStep);
  const double turn = d_.hasBias() ? largestTurn / std::max(d_.turnRate(), 1e-30) : none;
  return std::min({asked > 0 ? asked : none, limit, turn});
}

void TimeStepLimit::compute() {
  double &frequency = *d_.field(Field::highestFrequency), &damping = *d_.field(Field::dampingRate);
  frequency = damping = *d_.field(Field::angleTurned) = 0;
  *d_.field(Field::nodalTimeStep) = nodalStep(d_.model, d_.field(Field::addedMass), d_.field(Field::addedInertia),
                                              d_.field(Field::stiffness), d_.field(Field::rotationalStiffness));
  if (d_.model.anyFree() && !d_.springs.empty()) {
    double* mode = d_.has(Field::mode) ? d_.field(Field::mode) : nullptr;
    frequency = std::sqrt(spectrum_.largest(false, mode).bound());
    if (d_.has(Field::lagged)) damping = spectrum_.largest(true, nullptr).bound();
  }
  apply();
}

void TimeStepLimit::apply() {
  const double frequency = *d_.field(Field::highestFrequency);
  *d_.field(Field::stableTimeStep) = frequency > 0 ? 2 / frequency : none;
  *d_.field(Field::integratorLimit) = stableStep(d_.model.settings.method, frequency, *d_.field(Field::dampingRate));
}

void TimeStepLimit::update(double h, std::int64_t substeps) {
  double& turned = *d_.field(Field::angleTurned);
  turned += h * d_.turnRate();
  if (substeps % refreshEvery == 0 || turned > refreshTurn) refresh();
}

// Geometry changes the limit; the mode of the last look is where the next one starts.
void TimeStepLimit::refresh() {
  *d_.field(Field::angleTurned) = 0;
  if (!d_.has(Field::mode)) return;
  const Spectrum::Value value = spectrum_.refresh(d_.field(Field::mode));
  if (value.ritz > 0 && std::isfinite(value.bound())) {
    *d_.field(Field::highestFrequency) = std::sqrt(value.bound());
    apply();
  }
}

}  // namespace tiefmu
