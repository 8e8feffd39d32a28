#include "layout.hpp"

#include <algorithm>

namespace tiefmu {

Layout::Layout(const Model& model) {
  const std::size_t n = model.nodes(), r = model.rotating(), s = model.slaves(), u = model.turning();
  const std::size_t p = model.drivenPorts(), q = model.ports.size() - p;
  const auto any = [&](auto predicate) { return std::any_of(model.springs.begin(), model.springs.end(), predicate); };
  std::size_t meanMotion = 0;
  bool offsets = false, rotation = false;
  for (const TieGroup& group : model.groups) {
    rotation |= group.coupling == Coupling::rotation;
    if (group.coupling != Coupling::meanMotion) continue;
    meanMotion += group.segments();
    for (int k = 3 * group.firstSlave; k < 3 * (group.firstSlave + group.slaves()); ++k)
      offsets |= model.slaveOffset[k] != 0;
  }
  const bool segmentTurns = (model.finite() && offsets) || any([&](const Spring& spring) {
                              const auto of = [&](int k) { return k >= 0 && k < static_cast<int>(meanMotion); };
                              return of(spring.a.orientation) || of(spring.b.orientation);
                            });
  const bool damping =
      any([](const Spring& spring) { return !spring.damping.isZero(0) || !spring.rotationalDamping.isZero(0); });
  const bool dynamic = model.anyFree();
  const bool accelerations = dynamic || model.accelerationInputs() || model.exposes("slave.a");

  const auto put = [&](Field f, std::size_t count) {
    slices[static_cast<int>(f)] = {size, count};
    size += count;
  };
  put(Field::timeStep, 1);
  put(Field::safety, 1);
  put(Field::threads, 1);
  put(Field::slaveMass, s);
  put(Field::slaveInertia, u);
  put(Field::addedMass, n);
  put(Field::addedInertia, r);
  put(Field::stiffness, n);
  put(Field::rotationalStiffness, r);
  put(Field::nodeForce, dynamic ? 3 * n : 0);
  put(Field::nodeMoment, dynamic ? 3 * r : 0);
  put(Field::slaveForce, 3 * s);
  put(Field::slaveMoment, 3 * u);
  put(Field::portForce, 3 * q);
  put(Field::portMoment, 3 * q);
  put(Field::portVelocity, 3 * p);
  put(Field::portSpin, 3 * p);
  put(Field::portAcceleration, model.accelerationInputs() ? 3 * p : 0);
  put(Field::portAngularAcceleration, model.accelerationInputs() ? 3 * p : 0);
  put(Field::acceleration, accelerations ? 3 * n : 0);
  put(Field::angularAcceleration, accelerations ? 3 * r : 0);
  put(Field::velocity, 3 * n);
  put(Field::spin, 3 * r);
  put(Field::position, model.needsPositions() ? 3 * n : 0);
  put(Field::offset, 3 * u);
  put(Field::segmentRotation, segmentTurns ? 4 * meanMotion : 0);
  put(Field::orientation, 4 * model.oriented.size());
  put(Field::angle, !model.finite() && model.needsPositions() && rotation ? 3 * r : 0);
  put(Field::portPlace, 3 * p);
  put(Field::portRotation, model.finite() ? 4 * p : 0);
  put(Field::work, model.exposes("energy") ? 4 : 0);
  put(Field::lagged, dynamic && damping ? 3 * (n + r) : 0);
  put(Field::predicted,
      dynamic && model.settings.inertia == Inertia::consistent && model.finite() && u > 0 ? 3 * (n + r) : 0);
  put(Field::mode, dynamic && model.finite() && !model.springs.empty()
                       ? 3 * static_cast<std::size_t>(model.free() + model.rotating() - model.freeBegin())
                       : 0);
  put(Field::bounds, 4);
  put(Field::slaveVelocity, 3 * s);
  put(Field::slaveSpin, 3 * u);
  put(Field::reactionForce, 3 * n);
  put(Field::reactionMoment, 3 * r);
  put(Field::slavePosition, model.exposes("slave.r") ? 3 * s : 0);
  put(Field::slaveAcceleration, model.exposes("slave.a") ? 3 * s : 0);
  put(Field::portReaction, 3 * p);
  put(Field::portReactionMoment, 3 * p);
  put(Field::portMeanVelocity, 3 * q);
  put(Field::portMeanSpin, 3 * q);
  put(Field::portPosition, model.exposes("port.r") ? 3 * (p + q) : 0);
  put(Field::energy, model.exposes("energy") ? 5 : 0);
  put(Field::powerResidual, model.exposes("power_residual") ? 1 : 0);
  put(Field::drift, model.exposes("drift") ? 1 : 0);
  put(Field::stableTimeStep, 1);
  put(Field::nodalTimeStep, 1);
}

}  // namespace tiefmu
