#include "directional_derivative.hpp"

#include <algorithm>
#include <cmath>

namespace tiefmu {

DirectionalDerivative::DirectionalDerivative(Dynamics& dynamics) : d_(dynamics) {
  const Model& model = d_.model;
  for (auto* a : {&v_, &nodeLoad_, &f_, &keptForce_}) a->resize(3 * static_cast<std::size_t>(model.nodes()));
  for (auto* a : {&w_, &nodeMoment_, &t_, &keptMoment_}) a->resize(3 * static_cast<std::size_t>(model.rotating()));
  for (auto* a : {&xs_, &vs_, &load_, &as_, &bias_, &zero_}) a->resize(3 * static_cast<std::size_t>(model.slaves()));
  for (auto* a : {&ws_, &moment_, &zs_, &biasTurn_}) a->resize(3 * static_cast<std::size_t>(model.turning()));
}

const double* DirectionalDerivative::dx() const {
  return d_.has(Field::position) && !d_.positionsIntegrated() ? of(Field::position) : nullptr;
}

void DirectionalDerivative::evaluate(double* derivative) {
  derivative_ = derivative;
  if (d_.ports.anyDriven()) d_.ports.moveDerivative(derivative);
  differentiateLoads();
  std::fill(f_.begin(), f_.end(), 0.0);
  std::fill(t_.begin(), t_.end(), 0.0);
  distribute(load_, moment_, d_.loads.slaveForce(), d_.loads.slaveMoment());
  if (d_.model.anyFree()) evaluateAccelerations();
  differentiateOutputs();
}

// f_s and the loads on nodes.
void DirectionalDerivative::differentiateLoads() {
  const Model& model = d_.model;
  const int first = 3 * model.freeBegin(), last = 3 * model.freeEnd(), turning = 3 * model.rotating();
  std::copy_n(of(Field::slaveForce), load_.size(), load_.begin());
  std::copy_n(of(Field::slaveMoment), moment_.size(), moment_.begin());
  if (d_.ports.anyOfSlaves())
    d_.ports.distributeLoads(of(Field::portForce), of(Field::portMoment), load_.data(), moment_.data());
  std::fill(nodeLoad_.begin(), nodeLoad_.end(), 0.0);
  std::fill(nodeMoment_.begin(), nodeMoment_.end(), 0.0);
  if (d_.has(Field::nodeForce)) {
    std::copy(of(Field::nodeForce) + first, of(Field::nodeForce) + last, nodeLoad_.begin() + first);
    std::copy(of(Field::nodeMoment) + first, of(Field::nodeMoment) + turning, nodeMoment_.begin() + first);
  }
  if (!d_.springs.empty() || d_.has(Field::slavePosition)) {
    std::fill(xs_.begin(), xs_.end(), 0.0);
    if (dx())
      d_.ties.eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
        if (model.finite()) return place(group, range, {zero_.data(), shape.frame}, dx(), xs_.data());
        std::fill(w_.begin(), w_.end(), 0.0);
        mapMotion(group, range, shape, dx(), w_.data(), xs_.data(), biasTurn_.data());
      });
  }
  strain_ = 0;
  if (d_.springs.empty()) return;
  const double *v = d_.velocityFor(Field::lagged), *w = d_.spinFor(Field::lagged);
  const double *dv = of(Field::velocity), *dw = of(Field::spin);
  d_.ties.eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    mapMotion(group, range, shape, dv, dw, vs_.data(), ws_.data());
    if (dxOfFrames()) mapMotionDerivative(group, shape, dxOfFrames(), v, vs_.data(), ws_.data());
  });
  strain_ = d_.springs.addLoadDerivatives(v, w, {dx(), dv, dw, xs_.data(), vs_.data(), ws_.data()},
                                          {nodeLoad_.data(), nodeMoment_.data(), load_.data(), moment_.data()});
}

// T^T (force, moment) + (dT)^T (value, valueMoment), added to f_, t_.
void DirectionalDerivative::distribute(const std::vector<double>& force, const std::vector<double>& moment,
                                       const double* value, const double* valueMoment) {
  d_.ties.distributeLoads(force.data(), moment.data(), f_.data(), t_.data());
  if (dxOfFrames())
    d_.ties.eachGroup([&](const TieGroup& group, SegmentRange, TieGeometry shape, std::size_t) {
      distributeLoadsDerivative(group, shape, dxOfFrames(), value, valueMoment, f_.data());
    });
}

// Of the slaves' accelerations, T dq'' + (dT) q'' + db, to as_, zs_. `v`, `w`: of the bias; its derivative along the
// driven velocities is half the difference between both sides, exact for a quadratic form.
void DirectionalDerivative::differentiateAccelerations(const double* da, const double* dz, const double* v,
                                                       const double* w) {
  const Model& model = d_.model;
  const double *a = accelerations(), *dxf = dxOfFrames();
  d_.ties.eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    if (da) mapMotion(group, range, shape, da, dz, as_.data(), zs_.data());
    if (dxf && a) mapMotionDerivative(group, shape, dxf, a, as_.data(), zs_.data());
    if (dxf && d_.ties.hasBias()) biasDerivative(group, shape, dxf, v, as_.data(), zs_.data());
  });
  if (!d_.ties.hasBias()) return;
  const double *dv = of(Field::velocity), *dw = of(Field::spin);
  double largest = 0, size = 0;
  for (int k = 0; k < 3 * model.nodes(); ++k) {
    largest = std::max(largest, std::abs(dv[k]));
    size = std::max(size, std::abs(v[k]));
  }
  for (int k = 0; k < 3 * model.rotating(); ++k) {
    largest = std::max(largest, std::abs(dw[k]));
    size = std::max(size, std::abs(w[k]));
  }
  if (largest == 0 || size == 0) return;
  const double scale = size / largest;  // both sides of the same size as the motion: least rounding
  for (double side : {scale, -scale}) {
    for (int k = 0; k < 3 * model.nodes(); ++k) v_[k] = v[k] + side * dv[k];
    for (int k = 0; k < 3 * model.rotating(); ++k) w_[k] = w[k] + side * dw[k];
    std::fill(bias_.begin(), bias_.end(), 0.0);
    std::fill(biasTurn_.begin(), biasTurn_.end(), 0.0);
    d_.ties.addBias(v_.data(), w_.data(), bias_.data(), biasTurn_.data());
    for (std::size_t k = 0; k < as_.size(); ++k) as_[k] += bias_[k] / (2 * side);
    for (std::size_t k = 0; k < zs_.size(); ++k) zs_[k] += biasTurn_[k] / (2 * side);
  }
}

// Of the free nodes' accelerations, from the equation of motion; f_, t_ hold T^T f_s. Those of driven nodes are given.
void DirectionalDerivative::evaluateAccelerations() {
  const Model& model = d_.model;
  const int first = 3 * model.freeBegin(), last = 3 * model.freeEnd(), turning = 3 * model.rotating();
  double *da = of(Field::acceleration), *dz = of(Field::angularAcceleration);
  std::fill(da + first, da + last, 0.0);
  std::fill(dz + first, dz + turning, 0.0);
  const bool consistent = model.settings.inertia == Inertia::consistent;
  if (consistent) {
    keptForce_ = f_;
    keptMoment_ = t_;
    const double *v = d_.velocityFor(Field::predicted), *w = d_.spinFor(Field::predicted);
    d_.updateSlaveAccelerations(accelerations(), d_.field(Field::angularAcceleration), v, w);
    d_.turnIntoInertialLoads();
    differentiateAccelerations(da, dz, v, w);
    d_.turnIntoInertialLoads(as_.data(), zs_.data());
    distribute(as_, zs_, d_.slaveAcceleration().data(), d_.slaveAngularAcceleration().data());
  }
  for (int k = first; k < last; ++k) nodeLoad_[k] += f_[k];
  for (int k = first; k < turning; ++k) nodeMoment_[k] += t_[k];
  d_.solveInertia(nodeLoad_.data(), nodeMoment_.data(), da, dz);
  if (consistent) {
    f_ = keptForce_;
    t_ = keptMoment_;
  }
}

// In the order of their fields. Each output has its branch: one without does not compile.
void DirectionalDerivative::differentiateOutputs() {
  const Model& model = d_.model;
  const double *dv = of(Field::velocity), *dw = of(Field::spin);
  double *vs = of(Field::slaveVelocity), *ws = of(Field::slaveSpin);
  differentiateReactions();
  forEachField([&](auto constant) {
    constexpr Field f = constant;
    if (!d_.has(f)) return;
    [[maybe_unused]] double* out = of(f);
    if constexpr (f == Field::slaveVelocity) {
      d_.ties.eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
        mapMotion(group, range, shape, dv, dw, vs, ws);
        if (dxOfFrames()) mapMotionDerivative(group, shape, dxOfFrames(), d_.field(Field::velocity), vs, ws);
      });
    } else if constexpr (f == Field::slaveSpin) {
      // with the velocities
    } else if constexpr (f == Field::reactionForce) {
      std::copy(f_.begin(), f_.end(), out);
    } else if constexpr (f == Field::reactionMoment) {
      std::copy(t_.begin(), t_.end(), out);
    } else if constexpr (f == Field::slavePosition) {
      std::copy(xs_.begin(), xs_.end(), out);
    } else if constexpr (f == Field::slaveAcceleration) {
      std::copy(as_.begin(), as_.end(), out);
    } else if constexpr (f == Field::portReaction) {
      d_.ports.gather(f_.data(), t_.data(), out, of(Field::portReactionMoment));
      if (!d_.springs.empty())
        d_.ports.gather(nodeLoad_.data(), nodeMoment_.data(), out, of(Field::portReactionMoment));
    } else if constexpr (f == Field::portReactionMoment) {
      // with the forces
    } else if constexpr (f == Field::portMeanVelocity) {
      d_.ports.mapMotion(vs, ws, out, of(Field::portMeanSpin));
    } else if constexpr (f == Field::portMeanSpin) {
      // with the velocities
    } else if constexpr (f == Field::energy) {
      differentiateEnergies();
    } else if constexpr (f == Field::powerResidual) {
      // Of sum p.q.
      const auto power = [](int count, const double* p, const double* q, const double* dp, const double* dq) {
        double sum = 0;
        for (int i = 0; i < count; ++i) sum += at(dp, i).dot(at(q, i)) + at(p, i).dot(at(dq, i));
        return sum;
      };
      *out = 0;
      *out += power(model.slaves(), d_.loads.slaveForce(), d_.field(Field::slaveVelocity), load_.data(), vs);
      *out += power(model.turning(), d_.loads.slaveMoment(), d_.field(Field::slaveSpin), moment_.data(), ws);
      *out -= power(model.nodes(), d_.field(Field::reactionForce), d_.field(Field::velocity), f_.data(), dv);
      *out -= power(model.rotating(), d_.field(Field::reactionMoment), d_.field(Field::spin), t_.data(), dw);
    } else if constexpr (f == Field::portPosition || f == Field::drift) {
      // states: `out` stays zero
    } else if constexpr (f == Field::stableTimeStep || f == Field::nodalTimeStep) {
      // these follow from states and parameters
    } else {
      static_assert(rowOf(f).role != Role::output, "state how this output changes with the inputs");
    }
  });
}

// Of the slaves' accelerations to as_, zs_, and of the reactions to f_, t_.
void DirectionalDerivative::differentiateReactions() {
  const Model& model = d_.model;
  const double *v = d_.field(Field::velocity), *w = d_.field(Field::spin);
  const double* da = d_.has(Field::acceleration) ? of(Field::acceleration) : nullptr;
  const double* dz = of(Field::angularAcceleration);
  const bool consistent = model.settings.inertia == Inertia::consistent;
  const bool loads = model.settings.reaction == Reaction::loads, split = model.settings.reaction == Reaction::split;
  const bool inertial = consistent && !loads;
  if (inertial || d_.has(Field::slaveAcceleration)) {
    std::fill(as_.begin(), as_.end(), 0.0);
    std::fill(zs_.begin(), zs_.end(), 0.0);
    differentiateAccelerations(da, dz, v, w);
  }
  if (inertial) {
    d_.updateSlaveAccelerations(accelerations(), d_.field(Field::angularAcceleration), v, w);
    d_.turnIntoInertialLoads();
    bias_ = as_;
    biasTurn_ = zs_;
    d_.turnIntoInertialLoads(bias_.data(), biasTurn_.data());
    distribute(bias_, biasTurn_, d_.slaveAcceleration().data(), d_.slaveAngularAcceleration().data());
  }
  if (!loads && (!consistent || split)) {
    const double sign = split ? 1 : -1;
    for (int i = 0; i < model.nodes(); ++i) at(f_.data(), i) += sign * d_.field(Field::addedMass)[i] * at(da, i);
    for (int i = 0; i < model.rotating(); ++i) at(t_.data(), i) += sign * d_.field(Field::addedInertia)[i] * at(dz, i);
  }
}

void DirectionalDerivative::differentiateEnergies() {
  const Model& model = d_.model;
  const double *mass = d_.field(Field::slaveMass), *inertia = d_.field(Field::slaveInertia);
  const double *vs = d_.field(Field::slaveVelocity), *ws = d_.field(Field::slaveSpin);
  double kinetic = 0;
  for (int s = 0; s < model.slaves(); ++s) kinetic += mass[s] * at(vs, s).dot(at(of(Field::slaveVelocity), s));
  for (int s = 0; s < model.turning(); ++s) kinetic += inertia[s] * at(ws, s).dot(at(of(Field::slaveSpin), s));
  double* e = of(Field::energy);
  e[Energy::kinetic] = kinetic;
  e[Energy::strain] = strain_;
  e[Energy::dissipated] = e[Energy::external] = 0;  // sums over time
  e[Energy::residual] = kinetic + strain_;
}

}  // namespace tiefmu
