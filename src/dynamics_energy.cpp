// Energy, and the power that changes it (theory (4.10)).
#include <algorithm>

#include "dynamics.hpp"

namespace tiefmu {

double Dynamics::kineticEnergy() {
  const double *v = field(Field::velocity), *w = field(Field::spin);
  ties.mapMotion(v, w, vs_.data(), ws_.data());
  double twice = 0;
  for (int i = model.freeBegin(); i < model.freeEnd(); ++i) twice += model.nodeMass[i] * at(v, i).squaredNorm();
  for (int i = model.freeBegin(); i < model.rotating(); ++i) twice += model.nodeInertia[i] * at(w, i).squaredNorm();
  for (int s = 0; s < model.slaves(); ++s) twice += field(Field::slaveMass)[s] * at(vs_.data(), s).squaredNorm();
  for (int s = 0; s < model.turning(); ++s) twice += field(Field::slaveInertia)[s] * at(ws_.data(), s).squaredNorm();
  return 0.5 * twice;
}

Dynamics::Power Dynamics::power() {
  Power p{0, springs.dissipation()};
  const double *v = field(Field::velocity), *w = field(Field::spin);
  const Vec3& g = model.settings.gravity;
  for (int i = model.freeBegin(); i < model.freeEnd(); ++i)
    p.external += (at(field(Field::nodeForce), i) + model.nodeMass[i] * g).dot(at(v, i));
  for (int i = model.freeBegin(); i < model.rotating(); ++i)
    p.external += at(field(Field::nodeMoment), i).dot(at(w, i));
  ties.mapMotion(v, w, vs_.data(), ws_.data());
  for (int s = 0; s < model.slaves(); ++s)
    p.external += (at(field(Field::slaveForce), s) + field(Field::slaveMass)[s] * g).dot(at(vs_.data(), s));
  for (int s = 0; s < model.turning(); ++s) p.external += at(field(Field::slaveMoment), s).dot(at(ws_.data(), s));
  if (ports.anyOfSlaves()) p.external += ports.power(vs_.data(), ws_.data());
  if (!model.anyDriven()) return p;
  // The driven nodes' part: what holds them against springs and tie, inertia included.
  std::fill(right_.begin(), right_.end(), 0.0);
  std::fill(rightMoment_.begin(), rightMoment_.end(), 0.0);
  if (has(Field::acceleration)) {
    updateSlaveAccelerations(field(Field::acceleration), field(Field::angularAcceleration), v, w);
  } else {
    std::fill(as_.begin(), as_.end(), 0.0);
    std::fill(zs_.begin(), zs_.end(), 0.0);
    ties.addBias(v, w, as_.data(), zs_.data());
  }
  turnIntoInertialLoads();
  ties.distributeLoads(as_.data(), zs_.data(), right_.data(), rightMoment_.data());
  ties.distributeLoads(loads.slaveForce(), loads.slaveMoment(), right_.data(), rightMoment_.data());
  for (int i = 0; i < model.nodes(); ++i) {
    if (i >= model.freeBegin() && i < model.freeEnd()) continue;
    p.external -= (at(right_.data(), i) + at(loads.nodeForce(), i)).dot(at(v, i));
    if (i < model.rotating()) p.external -= (at(rightMoment_.data(), i) + at(loads.nodeMoment(), i)).dot(at(w, i));
  }
  return p;
}

}  // namespace tiefmu
