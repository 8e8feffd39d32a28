#include "outputs.hpp"

#include <algorithm>
#include <cmath>

namespace tiefmu {

void Outputs::update() {
  d_.ties.mapMotion(field(Field::velocity), field(Field::spin), field(Field::slaveVelocity), field(Field::slaveSpin));
  updateReactions();
  if (d_.has(Field::slavePosition)) d_.ties.placeSlaves(field(Field::slavePosition));
  if (!d_.model.ports.empty()) updatePorts();
  if (d_.has(Field::energy)) updateEnergies();
  if (d_.has(Field::powerResidual)) *field(Field::powerResidual) = powerResidual();
  if (d_.has(Field::drift)) *field(Field::drift) = drift();
}

// Reactions of the tie on the nodes as Settings::reaction says, and the slaves' accelerations.
void Outputs::updateReactions() {
  const Model& model = d_.model;
  const double *v = field(Field::velocity), *w = field(Field::spin);
  const bool consistent = model.settings.inertia == Inertia::consistent;
  const bool loads = model.settings.reaction == Reaction::loads, split = model.settings.reaction == Reaction::split;
  if (d_.has(Field::slaveAcceleration)) {
    d_.updateSlaveAccelerations(field(Field::acceleration), field(Field::angularAcceleration), v, w);
    std::copy(d_.slaveAcceleration().begin(), d_.slaveAcceleration().end(), field(Field::slaveAcceleration));
  }
  if (loads) return;  // T^T f_s, which an evaluation writes to the field
  const auto [a, z] = d_.answered();
  double *f = field(Field::reactionForce), *t = field(Field::reactionMoment);
  std::copy_n(d_.tieForce(), d_.layout[Field::reactionForce].count, f);
  std::copy_n(d_.tieMoment(), d_.layout[Field::reactionMoment].count, t);
  if (consistent) {
    if (!d_.has(Field::slaveAcceleration) || d_.has(Field::accelerationChange)) d_.updateSlaveAccelerations(a, z, v, w);
    d_.turnIntoInertialLoads();
    d_.ties.distributeLoads(d_.slaveAcceleration().data(), d_.slaveAngularAcceleration().data(), f, t);
  }
  // full, lumped: - D a. split: + D a.
  if (!consistent || split) {
    const double sign = split ? 1 : -1;
    for (int i = 0; i < model.nodes(); ++i) at(f, i) += sign * field(Field::addedMass)[i] * at(a, i);
    for (int i = 0; i < model.rotating(); ++i) at(t, i) += sign * field(Field::addedInertia)[i] * at(z, i);
  }
}

void Outputs::updatePorts() {
  if (d_.ports.anyDriven()) {
    double *force = field(Field::portReaction), *moment = field(Field::portReactionMoment);
    std::fill_n(force, d_.layout[Field::portReaction].count, 0.0);
    std::fill_n(moment, d_.layout[Field::portReactionMoment].count, 0.0);
    d_.ports.gather(field(Field::reactionForce), field(Field::reactionMoment), force, moment);
    if (!d_.springs.empty()) d_.ports.gather(d_.loads.nodeForce(), d_.loads.nodeMoment(), force, moment);
  }
  if (d_.ports.anyOfSlaves())
    d_.ports.mapMotion(field(Field::slaveVelocity), field(Field::slaveSpin), field(Field::portMeanVelocity),
                       field(Field::portMeanSpin));
  if (d_.has(Field::portPosition)) d_.ports.places(d_.attached.position(), field(Field::portPosition));
}

void Outputs::updateEnergies() {
  const double* work = field(Field::work);
  double* e = field(Field::energy);
  e[Energy::kinetic] = d_.kineticEnergy();
  e[Energy::strain] = d_.strainEnergy();
  e[Energy::dissipated] = work[Work::dissipated];
  e[Energy::external] = work[Work::external];
  e[Energy::residual] =
      e[Energy::kinetic] + e[Energy::strain] + e[Energy::dissipated] - e[Energy::external] - work[Work::totalAtStart];
}

// Power of the slaves' loads less that of the reactions, W.
double Outputs::powerResidual() const {
  const Model& model = d_.model;
  double sum = 0;
  for (int s = 0; s < model.slaves(); ++s) sum += at(d_.loads.slaveForce(), s).dot(at(field(Field::slaveVelocity), s));
  for (int s = 0; s < model.turning(); ++s) sum += at(d_.loads.slaveMoment(), s).dot(at(field(Field::slaveSpin), s));
  for (int i = 0; i < model.nodes(); ++i) sum -= at(field(Field::reactionForce), i).dot(at(field(Field::velocity), i));
  for (int i = 0; i < model.rotating(); ++i) sum -= at(field(Field::reactionMoment), i).dot(at(field(Field::spin), i));
  return sum;
}

// Largest change of an offset's length since the start, m.
double Outputs::drift() const {
  const Model& model = d_.model;
  double worst = 0;
  for (int s = 0; s < model.turning(); ++s)
    worst = std::max(worst, std::abs(at(field(Field::offset), s).norm() - at(model.slaveOffset.data(), s).norm()));
  return worst;
}

}  // namespace tiefmu
