#include "linearization.hpp"

#include <algorithm>

namespace tiefmu {
namespace {

// to += from, or transposed.
void add(Way way, std::size_t count, double* from, double* to) {
  if (way == Way::transposed) std::swap(from, to);
  for (std::size_t k = 0; k < count; ++k) to[k] += from[k];
}
void add(Way way, std::vector<double>& from, std::vector<double>& to) { add(way, from.size(), from.data(), to.data()); }

// sum += sign times the sum of weight p.dq, or transposed. weight: null where it is 1.
void addDot(Way way, int count, double sign, const double* weight, const double* p, double* dq, double& sum) {
  double part = 0;
  for (int i = 0; i < count; ++i) {
    const double factor = sign * (weight ? weight[i] : 1);
    if (way == Way::forward)
      part += factor * at(p, i).dot(at(dq, i));
    else
      at(dq, i) += sum * factor * at(p, i);
  }
  sum += part;
}

}  // namespace

Linearization::Linearization(Dynamics& dynamics) : d_(dynamics) {
  const Model& model = d_.model;
  const std::size_t n = 3 * static_cast<std::size_t>(model.nodes()), r = 3 * static_cast<std::size_t>(model.rotating());
  const std::size_t s = 3 * static_cast<std::size_t>(model.slaves()), u = 3 * static_cast<std::size_t>(model.turning());
  const auto resize = [](std::size_t size, auto... arrays) { (arrays->resize(size), ...); };
  resize(s, &load_, &slaves_);
  resize(u, &moment_, &turningSlaves_);
  resize(n, &f_, &nodeLoad_, &nodes_);
  resize(r, &t_, &nodeMoment_, &rotatingNodes_);
  if (model.anyFree()) {
    resize(n, &right_);
    resize(r, &rightMoment_);
  }
  if (!d_.springs.empty() || d_.has(Field::slavePosition)) {
    resize(s, &xs_, &vs_, &still_);
    resize(u, &ws_, &stillTurn_);
    resize(r, &stillTurnOfNodes_);
  }
  if (model.settings.inertia == Inertia::consistent || d_.has(Field::slaveAcceleration)) {
    resize(s, &as_);
    resize(u, &zs_);
  }
  if (d_.ports.anyDriven()) then([this](Way way) { d_.ports.differentiateMotion(way, array_); });
  chainLoads();
  if (model.anyFree()) chainAccelerations();
  chainReactions();
  chainOutputs();
}

void Linearization::start(double* array) {
  array_ = array;
  strain_ = 0;
  for (auto* a :
       {&xs_, &vs_, &ws_, &load_, &moment_, &nodeLoad_, &nodeMoment_, &as_, &zs_, &f_, &t_, &right_, &rightMoment_})
    std::fill(a->begin(), a->end(), 0.0);
}

void Linearization::directional(double* array) {
  start(array);
  for (const Link& link : chain_) link(Way::forward);
}

void Linearization::adjoint(double* array) {
  start(array);
  for (auto link = chain_.rbegin(); link != chain_.rend(); ++link) (*link)(Way::transposed);
}

// (us, turns) = T (u, turn) + (dT) value; transposed: added to u, turn and the nodes' places.
void Linearization::map(Way way, double* u, double* turn, const double* value, double* us, double* turns) {
  if (way == Way::forward)
    d_.ties.mapMotion(u, turn, us, turns);
  else
    d_.ties.distributeLoads(us, turns, u, turn);
  if (framesMove())
    d_.ties.eachGroup([&](const TieGroup& group, SegmentRange, TieGeometry shape, std::size_t) {
      mapMotionDerivative(way, group, shape, dx(), value, us, turns);
    });
}

// (f, t) += T^T (force, moment), of accelerations of the slaves (`inertial`) T^T of the loads of their inertia;
// transposed: added to force, moment.
void Linearization::distribute(Way way, bool inertial, std::vector<double>& force, std::vector<double>& moment,
                               std::vector<double>& f, std::vector<double>& t) {
  if (way == Way::forward) {
    slaves_ = force;
    turningSlaves_ = moment;
  } else {
    d_.ties.mapMotion(f.data(), t.data(), slaves_.data(), turningSlaves_.data());
  }
  if (inertial) d_.turnIntoInertialLoads(slaves_.data(), turningSlaves_.data());
  if (way == Way::forward) return d_.ties.distributeLoads(slaves_.data(), turningSlaves_.data(), f.data(), t.data());
  add(Way::forward, slaves_, force);
  add(Way::forward, turningSlaves_, moment);
}

// f += (dT)^T (force, moment); transposed: added to the nodes' places.
void Linearization::distributeByFrames(Way way, const double* force, const double* moment, double* f) {
  d_.ties.eachGroup([&](const TieGroup& group, SegmentRange, TieGeometry shape, std::size_t) {
    distributeLoadsDerivative(way, group, shape, dx(), force, moment, f);
  });
}

// f_s and the loads on nodes, and what the tie makes of f_s.
void Linearization::chainLoads() {
  then([this](Way way) {
    add(way, load_.size(), of(Field::slaveForce), load_.data());
    add(way, moment_.size(), of(Field::slaveMoment), moment_.data());
    if (!d_.has(Field::nodeForce)) return;
    add(way, nodeLoad_.size(), of(Field::nodeForce), nodeLoad_.data());
    add(way, nodeMoment_.size(), of(Field::nodeMoment), nodeMoment_.data());
  });
  if (d_.ports.anyOfSlaves())
    then([this](Way way) {
      if (way == Way::forward)
        d_.ports.distributeLoads(of(Field::portForce), of(Field::portMoment), load_.data(), moment_.data());
      else
        d_.ports.mapMotion(load_.data(), moment_.data(), of(Field::portForce), of(Field::portMoment));
    });
  if (!xs_.empty() && placesMove())
    then([this](Way way) {
      d_.ties.eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
        if (d_.model.finite()) shape.offset = still_.data();  // offsets are states: x_s moves as x_P or x_C
        if (way == Way::forward)
          mapMotion(group, range, shape, dx(), stillTurnOfNodes_.data(), xs_.data(), turningSlaves_.data());
        else
          distributeLoads(group, range, shape, xs_.data(), stillTurn_.data(), dx(), rotatingNodes_.data());
      });
    });
  if (!d_.springs.empty()) {
    then([this](Way way) {
      map(way, of(Field::velocity), of(Field::spin), d_.velocityFor(Field::lagged), vs_.data(), ws_.data());
    });
    then([this](Way way) {
      d_.springs.differentiate(way, d_.velocityFor(Field::lagged), d_.spinFor(Field::lagged),
                               {dx(), of(Field::velocity), of(Field::spin), xs_.data(), vs_.data(), ws_.data()},
                               {nodeLoad_.data(), nodeMoment_.data(), load_.data(), moment_.data()}, strain_);
    });
  }
  then([this](Way way) {
    distribute(way, false, load_, moment_, f_, t_);
    if (framesMove()) distributeByFrames(way, d_.loads.slaveForce(), d_.loads.slaveMoment(), f_.data());
  });
}

// Of the slaves' accelerations to as_, zs_: T q'' + b, with the bias of these velocities.
void Linearization::chainSlaveAccelerations(Field velocities, bool answered) {
  then([this, velocities, answered](Way way) {
    if (d_.has(Field::acceleration))
      map(way, of(Field::acceleration), of(Field::angularAcceleration), accelerations(answered).linear, as_.data(),
          zs_.data());
    if (!d_.ties.hasBias()) return;
    const double *v = velocityOf(velocities), *w = spinOf(velocities);
    const MotionChange change{dx(), of(Field::velocity), of(Field::spin)};
    d_.ties.eachGroup([&](const TieGroup& group, SegmentRange, TieGeometry shape, std::size_t) {
      biasDerivative(way, group, shape, v, w, change, as_.data(), zs_.data());
    });
  });
}

// Of the loads of the slaves' inertia, passed on to the nodes.
void Linearization::chainInertialLoads(Field velocities, bool answered, std::vector<double>& f,
                                       std::vector<double>& t) {
  then([this, velocities, answered, &f, &t](Way way) {
    distribute(way, true, as_, zs_, f, t);
    if (!framesMove()) return;
    const auto [a, z] = accelerations(answered);
    d_.updateSlaveAccelerations(a, z, velocityOf(velocities), spinOf(velocities));
    d_.turnIntoInertialLoads();
    distributeByFrames(way, d_.slaveAcceleration().data(), d_.slaveAngularAcceleration().data(), f.data());
  });
}

// The next ones are others.
void Linearization::startSlaveAccelerationsAnew() {
  then([this](Way) {
    std::fill(as_.begin(), as_.end(), 0.0);
    std::fill(zs_.begin(), zs_.end(), 0.0);
  });
}

// Of the free nodes' accelerations, from the equation of motion. Those of driven nodes are given.
void Linearization::chainAccelerations() {
  if (d_.model.settings.inertia == Inertia::consistent) {
    chainSlaveAccelerations(Field::predicted, false);
    chainInertialLoads(Field::predicted, false, right_, rightMoment_);
    startSlaveAccelerationsAnew();
  }
  then([this](Way way) {
    for (auto* load : {&f_, &nodeLoad_}) add(way, *load, right_);
    for (auto* load : {&t_, &nodeMoment_}) add(way, *load, rightMoment_);
  });
  then([this](Way way) {  // M^-1 is symmetric
    const bool forward = way == Way::forward;
    double *a = of(Field::acceleration), *z = of(Field::angularAcceleration);
    std::fill(nodes_.begin(), nodes_.end(), 0.0);
    std::fill(rotatingNodes_.begin(), rotatingNodes_.end(), 0.0);
    d_.solveInertia(forward ? right_.data() : a, forward ? rightMoment_.data() : z, nodes_.data(),
                    rotatingNodes_.data());
    add(Way::forward, nodes_.size(), nodes_.data(), forward ? a : right_.data());
    add(Way::forward, rotatingNodes_.size(), rotatingNodes_.data(), forward ? z : rightMoment_.data());
  });
}

// Of the slaves' accelerations to as_, zs_, and of the reactions to f_, t_.
void Linearization::chainReactions() {
  const Model& model = d_.model;
  const bool consistent = model.settings.inertia == Inertia::consistent;
  const bool loads = model.settings.reaction == Reaction::loads, split = model.settings.reaction == Reaction::split;
  const bool inertial = consistent && !loads;
  if (inertial) {
    chainSlaveAccelerations(Field::velocity, true);
    chainInertialLoads(Field::velocity, true, f_, t_);
    if (d_.has(Field::accelerationChange)) startSlaveAccelerationsAnew();
  }
  if (d_.has(Field::slaveAcceleration) && (!inertial || d_.has(Field::accelerationChange)))
    chainSlaveAccelerations(Field::velocity, false);
  if (loads || (consistent && !split)) return;
  then([this, sign = split ? 1.0 : -1.0](Way way) {
    const auto inertia = [&](int nodes, const double* added, double* a, double* load) {
      if (way == Way::transposed) std::swap(a, load);
      for (int i = 0; i < nodes; ++i) at(load, i) += sign * added[i] * at(a, i);
    };
    inertia(d_.model.nodes(), d_.field(Field::addedMass), of(Field::acceleration), f_.data());
    inertia(d_.model.rotating(), d_.field(Field::addedInertia), of(Field::angularAcceleration), t_.data());
  });
}

// In the order of their fields. Each output has its branch: one without does not compile.
void Linearization::chainOutputs() {
  forEachField([&](auto constant) {
    constexpr Field f = constant;
    if (!d_.has(f)) return;
    if constexpr (f == Field::slaveVelocity) {
      then([this](Way way) {
        map(way, of(Field::velocity), of(Field::spin), d_.field(Field::velocity), of(f), of(Field::slaveSpin));
      });
    } else if constexpr (f == Field::slaveSpin) {
      // with the velocities
    } else if constexpr (f == Field::reactionForce) {
      then([this](Way way) { add(way, f_.size(), f_.data(), of(f)); });
    } else if constexpr (f == Field::reactionMoment) {
      then([this](Way way) { add(way, t_.size(), t_.data(), of(f)); });
    } else if constexpr (f == Field::slavePosition) {
      then([this](Way way) { add(way, xs_.size(), xs_.data(), of(f)); });
    } else if constexpr (f == Field::slaveAcceleration) {
      then([this](Way way) { add(way, as_.size(), as_.data(), of(f)); });
    } else if constexpr (f == Field::portReaction) {
      then([this](Way way) {
        gather(way, f_, t_);
        if (!d_.springs.empty()) gather(way, nodeLoad_, nodeMoment_);
      });
    } else if constexpr (f == Field::portReactionMoment) {
      // with the forces
    } else if constexpr (f == Field::portMeanVelocity) {
      then([this](Way way) {
        double *vs = of(Field::slaveVelocity), *ws = of(Field::slaveSpin);
        if (way == Way::forward)
          d_.ports.mapMotion(vs, ws, of(f), of(Field::portMeanSpin));
        else
          d_.ports.distributeLoads(of(f), of(Field::portMeanSpin), vs, ws);
      });
    } else if constexpr (f == Field::portMeanSpin) {
      // with the velocities
    } else if constexpr (f == Field::energy) {
      then([this](Way way) { differentiateEnergies(way); });
    } else if constexpr (f == Field::powerResidual) {
      then([this](Way way) { differentiatePower(way); });
    } else if constexpr (f == Field::portPosition || f == Field::drift) {
      // states: their derivatives stay zero
    } else if constexpr (f == Field::stableTimeStep || f == Field::nodalTimeStep) {
      // these follow from states and parameters
    } else {
      static_assert(rowOf(f).role != Role::output, "state how this output changes with the inputs");
    }
  });
}

void Linearization::gather(Way way, std::vector<double>& f, std::vector<double>& t) {
  double *force = of(Field::portReaction), *moment = of(Field::portReactionMoment);
  if (way == Way::forward)
    d_.ports.gather(f.data(), t.data(), force, moment);
  else
    d_.ports.spread(force, moment, f.data(), t.data());
}

void Linearization::differentiateEnergies(Way way) {
  double *e = of(Field::energy), kinetic = 0;
  if (way == Way::transposed) {
    kinetic = e[Energy::kinetic] + e[Energy::residual];
    strain_ += e[Energy::strain] + e[Energy::residual];
  }
  addDot(way, d_.model.slaves(), 1, d_.field(Field::slaveMass), d_.field(Field::slaveVelocity),
         of(Field::slaveVelocity), kinetic);
  addDot(way, d_.model.turning(), 1, d_.field(Field::slaveInertia), d_.field(Field::slaveSpin), of(Field::slaveSpin),
         kinetic);
  if (way == Way::transposed) return;  // what is dissipated and comes from outside are sums over time
  e[Energy::kinetic] += kinetic;
  e[Energy::strain] += strain_;
  e[Energy::residual] += kinetic + strain_;
}

void Linearization::differentiatePower(Way way) {
  const Model& model = d_.model;
  double& power = *of(Field::powerResidual);
  const auto addProduct = [&](int count, double sign, const double* p, const double* q, double* dp, double* dq) {
    addDot(way, count, sign, nullptr, q, dp, power);
    addDot(way, count, sign, nullptr, p, dq, power);
  };
  addProduct(model.slaves(), 1, d_.loads.slaveForce(), d_.field(Field::slaveVelocity), load_.data(),
             of(Field::slaveVelocity));
  addProduct(model.turning(), 1, d_.loads.slaveMoment(), d_.field(Field::slaveSpin), moment_.data(),
             of(Field::slaveSpin));
  addProduct(model.nodes(), -1, d_.field(Field::reactionForce), d_.field(Field::velocity), f_.data(),
             of(Field::velocity));
  addProduct(model.rotating(), -1, d_.field(Field::reactionMoment), d_.field(Field::spin), t_.data(), of(Field::spin));
}

}  // namespace tiefmu
