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
  ahead_.resize(layout[Field::accelerationChange].count);
  if (consistent || energy || has(Field::slaveAcceleration)) {
    as_.resize(3 * s);
    zs_.resize(3 * u);
    right_.resize(3 * n);
    rightMoment_.resize(3 * r);
  }
  if (consistent && model.anyFree()) {
    islands_ = std::make_unique<Islands>(model);
    inertia_ = ConsistentInertia::of(model, islands_->alone().rest);
    sumsReactions_ =
        !islands_->alone().allFree || has(Field::powerResidual) || model.settings.reaction != Reaction::loads;
  }
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
  if (islands_) islands_->update(field(Field::slaveMass), field(Field::slaveInertia));
  if (!inertia_) return;
  inertia_->prepare(field(Field::slaveMass), field(Field::slaveInertia));
  updateInertia();
}

void Dynamics::updateMass() {
  if (inertia_ && !inertia_->constant() && massOf_ != ties.changes()) updateInertia();
}

void Dynamics::updateInertia() {
  massOf_ = -1;  // not yet, if it throws
  inertia_->update(
      {ties, field(Field::slaveMass), field(Field::slaveInertia), field(Field::offset), segmentRotations()});
  massOf_ = ties.changes();
}

// Of the nodes and segments that are factored; the others tell it when they are solved.
void Dynamics::updateTurnRate(const double* v, const double* w) {
  if (!inertia_ || has(Field::guess)) return;
  double rate2 = turnRate_ * turnRate_;
  for (int i : islands_->alone().rest) {
    const int node = model.freeBegin() + i;
    if (node < model.rotating()) rate2 = std::max(rate2, at(w, node).squaredNorm());
  }
  turnRate_ = std::sqrt(std::max(rate2, ties.largestSpin2(v, islands_->alone().held)));
}

void Dynamics::gatherLoads() {
  loads.gather(velocityFor(Field::lagged), spinFor(Field::lagged));
  turnRate_ = std::sqrt(springs.largestTurnRate2());
  if (hasBias()) updateTurnRate(velocityFor(Field::predicted), spinFor(Field::predicted));
}

void Dynamics::evaluateLoads() {
  gatherLoads();
  if (sumsReactions_) sumReactions();
  if (!hasBias()) return;
  // How fast the others turn shows where they are solved.
  std::copy_n(field(Field::acceleration), right_.size(), right_.begin());
  std::copy_n(field(Field::angularAcceleration), rightMoment_.size(), rightMoment_.begin());
  solveIslands(right_.data(), rightMoment_.data());
  if (has(Field::guess)) leaveLoads();
}

void Dynamics::bringReactions() {
  if (!sumsReactions_) sumReactions();
}

void Dynamics::sumReactions() {
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

Dynamics::Accelerations Dynamics::answered() {
  const double *a = field(Field::acceleration), *z = field(Field::angularAcceleration);
  if (!has(Field::accelerationChange)) return {a, z};
  const double *change = field(Field::accelerationChange), lead = model.settings.reactionLead;
  const std::size_t nodes = layout[Field::acceleration].count;
  for (std::size_t k = 0; k < ahead_.size(); ++k) ahead_[k] = (k < nodes ? a[k] : z[k - nodes]) + lead * change[k];
  return {ahead_.data(), ahead_.data() + nodes};
}

void Dynamics::holdAccelerations(bool before) {
  if (!has(Field::accelerationChange)) return;
  const int first = 3 * model.freeBegin(), last = 3 * model.freeEnd(), end = 3 * model.nodes();
  double *held = field(Field::heldAcceleration), *change = field(Field::accelerationChange);
  const auto hold = [&](int begin, int count, const double* now) {
    for (int k = 0; k < count; ++k) {
      change[begin + k] = before ? now[k] - held[begin + k] : 0;
      held[begin + k] = now[k];
    }
  };
  hold(0, first, field(Field::acceleration));
  hold(last, end - last, field(Field::acceleration) + last);
  hold(end, first, field(Field::angularAcceleration));
}

// In place of the slaves' accelerations the loads less what these take.
void Dynamics::turnIntoLoads(const double* force, const double* moment) {
  const auto turn = [&](int slaves, const double* load, const double* inertia, double* value) {
    ties.eachBlock(slaves, [&](std::size_t first, std::size_t last) {
      for (std::size_t s = first; s < last; ++s) at(value, s) = at(load, s) - inertia[s] * at(value, s);
    });
  };
  turn(model.slaves(), force, field(Field::slaveMass), as_.data());
  turn(model.turning(), moment, field(Field::slaveInertia), zs_.data());
}

void Dynamics::turnIntoInertialLoads(double* as, double* zs) {
  const double *mass = field(Field::slaveMass), *inertia = field(Field::slaveInertia);
  for (int s = 0; s < model.slaves(); ++s) at(as, s) *= -mass[s];
  for (int s = 0; s < model.turning(); ++s) at(zs, s) *= -inertia[s];
}

SegmentLoads Dynamics::loadsOnSegments() {
  return {loads.nodeForce(),
          loads.nodeMoment(),
          loads.slaveForce(),
          loads.slaveMoment(),
          field(Field::slaveMass),
          field(Field::slaveInertia),
          ties.hasBias() ? velocityFor(Field::predicted) : nullptr,
          spinFor(Field::predicted),
          segmentRotations(),
          knownAccelerations_};
}

void Dynamics::solveIslands(double* a, double* z) {
  const double rate2 = islands_->solve(ties, loadsOnSegments(), a, z);
  turnRate_ = std::max(turnRate_, std::sqrt(rate2));
}

void Dynamics::evaluate() {
  ++evaluations;
  gatherLoads();
  if (sumsReactions_) sumReactions();
  const int first = model.freeBegin(), last = model.freeEnd(), turning = model.rotating();
  const double *f = tieForce_, *t = tieMoment_;
  double *a = field(Field::acceleration), *z = field(Field::angularAcceleration);
  if (!islands_) {
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
  solveIslands(a, z);
  if (!inertia_) return;
  updateMass();
  if (has(Field::guess)) return iterate(a, z);
  // The free nodes' accelerations count as zero for now.
  for (int i : islands_->alone().rest) {
    at(a, first + i).setZero();
    if (first + i < turning) at(z, first + i).setZero();
  }
  const double *fs = loads.slaveForce(), *ts = loads.slaveMoment();
  if (ties.hasBias() || knownAccelerations_) {
    updateSlaveAccelerations(a, z, velocityFor(Field::predicted), spinFor(Field::predicted));
    turnIntoLoads(fs, ts);
    fs = as_.data();
    ts = zs_.data();
  }
  std::copy_n(loads.nodeForce(), right_.size(), right_.begin());
  std::copy_n(loads.nodeMoment(), rightMoment_.size(), rightMoment_.begin());
  ties.distributeLoads(fs, ts, right_.data(), rightMoment_.data());
  inertia_->solve(ties, model.settings.solverTolerance, right_.data(), rightMoment_.data(), a, z);
}

void Dynamics::leaveLoads() {
  const double rate2 = inertia_->leave(ties, loadsOnSegments(), field(Field::offset), field(Field::acceleration),
                                       field(Field::angularAcceleration));
  turnRate_ = std::max(turnRate_, std::sqrt(rate2));
}

void Dynamics::iterate(double* a, double* z) {
  const int first = model.freeBegin();
  const double *guess = field(Field::guess), *jump = field(Field::jump);
  double* solution = field(Field::solution);
  const auto set = [&](auto value) {
    for (int i : islands_->alone().rest) {
      at(a, first + i) = value(i);
      if (first + i < model.rotating()) at(z, first + i) = value(model.free() + i);
    }
  };
  const Along along{solution[Solution::jumpEnergy], jump - 3 * first, jump + 3 * (model.free() - first)};
  set([&](int i) -> Vec3 { return at(guess, i); });
  leaveLoads();
  const bool afresh = !inertia_->start(ties, along);
  if (afresh) {
    set([](int) -> Vec3 { return Vec3::Zero(); });
    leaveLoads();
    inertia_->start(ties, along);
  }
  const Correction correction = inertia_->finish(ties, model.settings.solverTolerance, a, z);
  solution[Solution::residual] = correction.residual;
  solution[Solution::energy] = correction.energy;
  solution[Solution::afresh] = afresh;
}

// body(values now, free nodes' values as in the fields of the iteration, how many)
template <class Body> void Dynamics::eachFree(Body body) {
  const int first = 3 * model.freeBegin(), free = 3 * model.free(), turning = 3 * model.rotating() - first;
  body(field(Field::acceleration) + first, 0, free);
  body(field(Field::angularAcceleration) + first, free, turning);
}

void Dynamics::rememberJump() {
  if (!has(Field::guess)) return;
  double *guess = field(Field::guess), *jump = field(Field::jump), *solution = field(Field::solution);
  // The same inputs have left the same residual as in the step before.
  if (solution[Solution::residual] == solution[Solution::residualInStep]) return;
  const bool afresh = solution[Solution::afresh] != 0;
  eachFree([&](const double* now, int begin, int count) {
    for (int i = 0; i < count; ++i) jump[begin + i] = afresh ? now[i] : now[i] - guess[begin + i];
  });
  solution[Solution::jumpEnergy] = solution[Solution::energy];
}

void Dynamics::guessAccelerations() {
  if (!has(Field::guess)) return;
  double *guess = field(Field::guess), *increment = field(Field::increment);
  eachFree([&](const double* now, int begin, int count) {
    for (int i = 0; i < count; ++i) guess[begin + i] = now[i] + increment[begin + i];
  });
}

void Dynamics::rememberIncrement() {
  if (!has(Field::guess)) return;
  double *guess = field(Field::guess), *increment = field(Field::increment), *solution = field(Field::solution);
  const bool afresh = solution[Solution::afresh] != 0;
  eachFree([&](const double* now, int begin, int count) {
    for (int i = 0; i < count; ++i)
      increment[begin + i] = afresh ? 0 : now[i] - (guess[begin + i] - increment[begin + i]);
  });
  solution[Solution::residualInStep] = solution[Solution::residual];
}

void Dynamics::setForceVelocities(double aheadOfLagged, double aheadOfPredicted) {
  if (!has(Field::lagged) && !has(Field::predicted)) return;
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
  if (islands_) {
    SegmentLoads onSegments = loadsOnSegments();
    onSegments.nodeForce = f;
    onSegments.nodeMoment = t;
    onSegments.slaveForce = onSegments.slaveMoment = onSegments.velocity = nullptr;
    onSegments.known = false;
    islands_->solve(ties, onSegments, a, z);
    constexpr double tolerance = 1e-12;  // of limits and derivatives
    if (inertia_) inertia_->solve(ties, tolerance, f, t, a, z);
    return;
  }
  for (int i = first; i < last; ++i) at(a, i) = at(f, i) / (model.nodeMass[i] + field(Field::addedMass)[i]);
  for (int i = first; i < turning; ++i) at(z, i) = at(t, i) / (model.nodeInertia[i] + field(Field::addedInertia)[i]);
}

}  // namespace tiefmu
