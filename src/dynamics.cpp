#include "dynamics.hpp"

#include <algorithm>
#include <cmath>

namespace tiefmu {
namespace {

void fill(double* to, std::size_t count, const std::vector<double>& from) { std::copy_n(from.begin(), count, to); }

}  // namespace

Dynamics::Dynamics(const Model& m, const Layout& l, double* d)
    : model(m),
      layout(l),
      data(d),
      ties(m, l, d),
      attached(m, ties),
      springs(m, l, d, attached),
      ports(m, l, d),
      loads(m, l, d, attached, springs, ports) {
  const std::size_t n = model.nodes(), r = model.rotating(), s = model.slaves(), u = model.turning();
  const bool energy = has(Field::energy), consistent = model.settings.inertia == Inertia::consistent;
  knownAccelerations_ = model.accelerationInputs() && model.anyDriven();
  positionsIntegrated_ = model.settings.position == Position::integrated;

  tieForce_ = field(Field::reactionForce);
  tieMoment_ = field(Field::reactionMoment);
  if (model.settings.reaction != Reaction::loads) {
    tieForceScratch_.resize(3 * n);
    tieMomentScratch_.resize(3 * r);
    tieForce_ = tieForceScratch_.data();
    tieMoment_ = tieMomentScratch_.data();
  }
  if (model.anyFree()) {
    step_.resize(3 * n);
    stepSpin_.resize(3 * r);
  }
  if (energy) {
    vs_.resize(3 * s);
    ws_.resize(3 * u);
  }
  if (consistent || energy || has(Field::slaveAcceleration)) {
    as_.resize(3 * s);
    zs_.resize(3 * u);
    right_.resize(3 * n);
    rightMoment_.resize(3 * r);
  }
  if (consistent && model.anyFree()) inertia_ = ConsistentInertia::of(model);
}

void Dynamics::setStart() {
  std::fill(data, data + layout.size, 0.0);
  *field(Field::timeStep) = model.settings.timeStep;
  *field(Field::safety) = model.settings.safety;
  *field(Field::threads) = std::max(1, model.settings.threads);
  ties.stopThreads();
  fill(field(Field::slaveMass), layout[Field::slaveMass].count, model.slaveMass);
  fill(field(Field::slaveInertia), layout[Field::slaveInertia].count, model.slaveInertia);
  fill(field(Field::velocity), layout[Field::velocity].count, model.nodeVelocity);
  fill(field(Field::spin), layout[Field::spin].count, model.nodeSpin);
  fill(field(Field::position), layout[Field::position].count, model.nodePosition);
  fill(field(Field::offset), layout[Field::offset].count, model.slaveOffset);
  for (Field f : {Field::segmentRotation, Field::orientation})
    for (std::size_t k = 0; k < layout[f].count; k += 4) field(f)[k] = 1;
  ports.setStart();
  *field(Field::stableTimeStep) = *field(Field::nodalTimeStep) = 1e30;
}

void Dynamics::prepare() {
  ties.startThreads();
  lumpedAdditions(model, field(Field::slaveMass), field(Field::slaveInertia), field(Field::addedMass),
                  field(Field::addedInertia));
  nodalStiffness(model, field(Field::stiffness), field(Field::rotationalStiffness));
  if (model.settings.inertia == Inertia::lumped) {
    const double *mass = field(Field::addedMass), *inertia = field(Field::addedInertia);
    for (int i = model.freeBegin(); i < model.freeEnd(); ++i) {
      const std::string node = "node " + std::to_string(model.nodeId[i]) + ": is free but has no ";
      const std::string cure = " of its own and gets none from its slaves; give it ";
      if (!(model.nodeMass[i] + mass[i] > 0)) throw SceneError(node + "mass" + cure + "mass");
      if (i < model.rotating() && !(model.nodeInertia[i] + inertia[i] > 0))
        throw SceneError(node + "inertia" + cure + "inertia, or rotations = false");
    }
  }
  prepareMass();
  setForceVelocities(0, 0);
}

void Dynamics::prepareMass() {
  if (!model.finite()) ties.updateFramesAtStart();
  ties.updateGeometry();
  if (inertia_) updateInertia();
}

void Dynamics::updateMass() {
  if (inertia_ && !inertia_->constant()) updateInertia();
}

void Dynamics::updateInertia() {
  inertia_->update(model.nodeMass.data(), model.nodeInertia.data(), field(Field::slaveMass), field(Field::slaveInertia),
                   field(Field::offset), ties.frames());
}

void Dynamics::updateTurnRate(const double* v, const double* w) {
  double rate2 = turnRate_ * turnRate_;
  for (int i = model.freeBegin(); i < model.rotating(); ++i) rate2 = std::max(rate2, at(w, i).squaredNorm());
  turnRate_ = std::sqrt(std::max(rate2, ties.largestSpin2(v)));
}

void Dynamics::evaluateLoads() {
  loads.gather(velocityFor(Field::lagged), spinFor(Field::lagged));
  turnRate_ = std::sqrt(springs.largestTurnRate2());
  if (hasBias()) updateTurnRate(velocityFor(Field::predicted), spinFor(Field::predicted));
  const auto clear = [&](double* value, std::size_t count) {
    ties.eachBlock(count, [&](std::size_t first, std::size_t last) { std::fill(value + first, value + last, 0.0); });
  };
  clear(tieForce_, layout[Field::reactionForce].count);
  clear(tieMoment_, layout[Field::reactionMoment].count);
  ties.distributeLoads(loads.slaveForce(), loads.slaveMoment(), tieForce_, tieMoment_);
}

void Dynamics::updateSlaveAccelerations(const double* a, const double* z, const double* v, const double* w) {
  ties.mapAccelerations(a, z, v, w, as_.data(), zs_.data());
}

void Dynamics::turnIntoInertialLoads(double* as, double* zs) {
  const double *mass = field(Field::slaveMass), *inertia = field(Field::slaveInertia);
  for (int s = 0; s < model.slaves(); ++s) at(as, s) *= -mass[s];
  for (int s = 0; s < model.turning(); ++s) at(zs, s) *= -inertia[s];
}

void Dynamics::evaluate() {
  ++evaluations;
  evaluateLoads();
  const int first = model.freeBegin(), last = model.freeEnd(), turning = model.rotating();
  const double *f = tieForce_, *t = tieMoment_;
  double *a = field(Field::acceleration), *z = field(Field::angularAcceleration);
  if (!inertia_) {
    const double *mass = field(Field::addedMass), *inertia = field(Field::addedInertia);
    ties.eachBlock(last - first, [&](std::size_t i, std::size_t end) {
      i += first;
      end += first;
      accelerate(end - i, loads.nodeForce() + 3 * i, f + 3 * i, &model.nodeMass[i], mass + i, a + 3 * i);
    });
    ties.eachBlock(turning - first, [&](std::size_t i, std::size_t end) {
      i += first;
      end += first;
      accelerate(end - i, loads.nodeMoment() + 3 * i, t + 3 * i, &model.nodeInertia[i], inertia + i, z + 3 * i);
    });
    return;
  }
  updateMass();
  std::copy_n(f, right_.size(), right_.begin());
  std::copy_n(t, rightMoment_.size(), rightMoment_.begin());
  if (ties.hasBias() || knownAccelerations_) {
    // What is known of the slaves' acceleration: that of the driven masters, and the bias.
    std::copy_n(a, step_.size(), step_.begin());
    std::copy_n(z, stepSpin_.size(), stepSpin_.begin());
    std::fill(step_.begin() + 3 * first, step_.begin() + 3 * last, 0.0);
    std::fill(stepSpin_.begin() + 3 * first, stepSpin_.end(), 0.0);
    updateSlaveAccelerations(step_.data(), stepSpin_.data(), velocityFor(Field::predicted), spinFor(Field::predicted));
    turnIntoInertialLoads();
    ties.distributeLoads(as_.data(), zs_.data(), right_.data(), rightMoment_.data());
  }
  for (int i = 3 * first; i < 3 * last; ++i) right_[i] += loads.nodeForce()[i];
  for (int i = 3 * first; i < 3 * turning; ++i) rightMoment_[i] += loads.nodeMoment()[i];
  inertia_->solve(right_.data() + 3 * first, rightMoment_.data() + 3 * first, a + 3 * first, z + 3 * first);
}

void Dynamics::setForceVelocities(double aheadOfLagged, double aheadOfPredicted) {
  for (Field f : {Field::lagged, Field::predicted}) {
    if (!has(f)) continue;
    double *v = field(f), *w = v + 3 * model.nodes();
    std::copy_n(field(Field::velocity), layout[Field::velocity].count, v);
    std::copy_n(field(Field::spin), layout[Field::spin].count, w);
    const double ahead = f == Field::lagged ? aheadOfLagged : aheadOfPredicted;
    if (ahead == 0) continue;
    const double *a = field(Field::acceleration), *z = field(Field::angularAcceleration);
    for (int i = 3 * model.freeBegin(); i < 3 * model.freeEnd(); ++i) v[i] += ahead * a[i];
    for (int i = 3 * model.freeBegin(); i < 3 * model.rotating(); ++i) w[i] += ahead * z[i];
  }
}

void Dynamics::takeDrivenVelocities() {
  const int first = 3 * model.freeBegin(), last = 3 * model.freeEnd(), end = 3 * model.nodes();
  for (Field f : {Field::lagged, Field::predicted}) {
    if (!has(f)) continue;
    const double *v = field(Field::velocity), *w = field(Field::spin);
    std::copy(v, v + first, field(f));
    std::copy(v + last, v + end, field(f) + last);
    std::copy(w, w + first, field(f) + end);
  }
}

void Dynamics::solveInertia(const double* f, const double* t, double* a, double* z) {
  const int first = model.freeBegin(), last = model.freeEnd(), turning = model.rotating();
  if (inertia_) return inertia_->solve(f + 3 * first, t + 3 * first, a + 3 * first, z + 3 * first);
  for (int i = first; i < last; ++i) at(a, i) = at(f, i) / (model.nodeMass[i] + field(Field::addedMass)[i]);
  for (int i = first; i < turning; ++i) at(z, i) = at(t, i) / (model.nodeInertia[i] + field(Field::addedInertia)[i]);
}

}  // namespace tiefmu
