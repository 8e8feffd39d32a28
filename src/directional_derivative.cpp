// Directional derivatives of the outputs: the pipeline of dynamics.cpp, differentiated.
#include <algorithm>

#include "dynamics.hpp"

namespace tiefmu {

struct Dynamics::Derivative {
  std::vector<double> u, turn;           // nodes: a motion whose free part is zero
  std::vector<double> v, w;              // values to perturb the quadratic bias about
  std::vector<double> xs, us, turns;     // slaves: positions, velocities
  std::vector<double> load, moment;      // f_s
  std::vector<double> node, nodeMoment;  // loads on nodes
  std::vector<double> as, zs, other, otherTurn;
  std::vector<double> f, t, zero;

  explicit Derivative(const Model& model) {
    const std::size_t n = 3 * static_cast<std::size_t>(model.nodes()),
                      r = 3 * static_cast<std::size_t>(model.rotating());
    const std::size_t s = 3 * static_cast<std::size_t>(model.slaves()),
                      k = 3 * static_cast<std::size_t>(model.turning());
    for (auto* a : {&u, &v, &node, &f}) a->resize(n);
    for (auto* a : {&turn, &w, &nodeMoment, &t}) a->resize(r);
    for (auto* a : {&xs, &us, &load, &as, &other, &zero}) a->resize(s);
    for (auto* a : {&turns, &moment, &zs, &otherTurn}) a->resize(k);
  }
};

// Accelerations of the slaves change by T dq'' + (dT) q'' + db into change.as, zs. `v`, `w`: of the bias; its change
// with the driven velocities du, dturn is half the difference between both sides, exact for a quadratic form.
void Dynamics::differentiateAccelerations(Derivative& c, const double* da, const double* dz, const double* a,
                                          const double* v, const double* w, const double* du, const double* dturn,
                                          const double* dx) {
  eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    if (da) mapMotion(group, range, shape, da, dz, c.as.data(), c.zs.data());
    if (dx && a) mapMotionDerivative(group, shape, dx, a, c.as.data(), c.zs.data());
    if (dx && bias_) biasDerivative(group, shape, dx, v, c.as.data(), c.zs.data());
  });
  if (!bias_) return;
  double largest = 0, size = 0;
  for (int k = 0; k < 3 * model.nodes(); ++k) {
    largest = std::max(largest, std::abs(du[k]));
    size = std::max(size, std::abs(v[k]));
  }
  for (int k = 0; k < 3 * model.rotating(); ++k) {
    largest = std::max(largest, std::abs(dturn[k]));
    size = std::max(size, std::abs(w[k]));
  }
  if (largest == 0 || size == 0) return;
  const double scale = size / largest;  // both sides of the same size as the motion: least rounding
  for (double side : {scale, -scale}) {
    for (int k = 0; k < 3 * model.nodes(); ++k) c.v[k] = v[k] + side * du[k];
    for (int k = 0; k < 3 * model.rotating(); ++k) c.w[k] = w[k] + side * dturn[k];
    std::fill(c.other.begin(), c.other.end(), 0.0);
    std::fill(c.otherTurn.begin(), c.otherTurn.end(), 0.0);
    eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
      addBias(group, range, shape, c.v.data(), c.w.data(), c.other.data(), c.otherTurn.data());
    });
    for (std::size_t k = 0; k < c.as.size(); ++k) c.as[k] += c.other[k] / (2 * side);
    for (std::size_t k = 0; k < c.zs.size(); ++k) c.zs[k] += c.otherTurn[k] / (2 * side);
  }
}

void Dynamics::directionalDerivative(double* derivative) {
  if (!derivative_) derivative_ = std::make_shared<Derivative>(model);
  Derivative& c = *derivative_;
  const auto seed = [&](Field f) { return derivative + layout[f].offset; };
  const int first = 3 * model.freeBegin(), last = 3 * model.freeEnd();
  const int turning = 3 * model.rotating();
  const bool consistent = model.settings.inertia == Inertia::consistent;
  const double *mass = field(Field::slaveMass), *inertia = field(Field::slaveInertia);
  const double* a = has(Field::acceleration) ? field(Field::acceleration) : nullptr;
  const double* z = field(Field::angularAcceleration);
  const double *v = field(Field::velocity), *w = field(Field::spin);
  const double *du = seed(Field::velocity), *dturn = seed(Field::spin);
  const double* dx = nullptr;
  if (has(Field::position) && !drivenMove_) dx = seed(Field::position);
  const double* shapeChange = model.finite() ? dx : nullptr;

  if (ports.anyDriven()) ports.moveDerivative(derivative);

  // f_s
  std::copy_n(seed(Field::slaveForce), c.load.size(), c.load.begin());
  std::copy_n(seed(Field::slaveMoment), c.moment.size(), c.moment.begin());
  if (ports.anyOfSlaves())
    ports.distributeLoads(seed(Field::portForce), seed(Field::portMoment), c.load.data(), c.moment.data());
  std::fill(c.node.begin(), c.node.end(), 0.0);
  std::fill(c.nodeMoment.begin(), c.nodeMoment.end(), 0.0);
  if (has(Field::nodeForce)) {
    std::copy(seed(Field::nodeForce) + first, seed(Field::nodeForce) + last, c.node.begin() + first);
    std::copy(seed(Field::nodeMoment) + first, seed(Field::nodeMoment) + turning, c.nodeMoment.begin() + first);
  }
  double strain = 0;
  if (!model.springs.empty() || has(Field::slavePosition)) {
    std::fill(c.xs.begin(), c.xs.end(), 0.0);
    eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
      if (!dx) return;
      if (model.finite()) return place(group, range, {c.zero.data(), shape.frame}, dx, c.xs.data());
      std::fill(c.t.begin(), c.t.end(), 0.0);
      mapMotion(group, range, shape, dx, c.t.data(), c.xs.data(), c.otherTurn.data());
    });
  }
  if (!model.springs.empty()) {
    const double *vl = velocityFor(Field::lagged), *wl = spinFor(Field::lagged);
    placeSlaves(xs_.data(), true);
    eachSprung([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
      mapMotion(group, range, shape, vl, wl, vs_.data(), ws_.data());
    });
    eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
      mapMotion(group, range, shape, du, dturn, c.us.data(), c.turns.data());
      if (shapeChange) mapMotionDerivative(group, shape, shapeChange, vl, c.us.data(), c.turns.data());
    });
    const auto changeOf = [&](const SpringEnd& end) {
      EndMotion m;
      if (end.node >= 0) {
        if (dx) m.x = at(dx, end.node);
        m.v = at(du, end.node);
        if (end.node < model.rotating()) m.w = at(dturn, end.node);
      } else if (end.slave >= 0) {
        m.x = at(c.xs.data(), end.slave);
        m.v = at(c.us.data(), end.slave);
        if (end.slave < model.turning()) m.w = at(c.turns.data(), end.slave);
      }
      return m;
    };
    for (const Spring& spring : model.springs) {
      const SpringLoad l =
          springLoadDerivative(spring, motion(spring.a, spring, vl, wl), motion(spring.b, spring, vl, wl),
                               changeOf(spring.a), changeOf(spring.b));
      addTo(spring.a, l.fa, l.ta, c.node.data(), c.nodeMoment.data(), c.load.data(), c.moment.data());
      addTo(spring.b, l.fb, l.tb, c.node.data(), c.nodeMoment.data(), c.load.data(), c.moment.data());
      strain += l.energy;
    }
  }

  // T^T f_s
  const auto spread = [&](const double* force, const double* moment, const double* value, const double* valueMoment) {
    distributeAll(force, moment, c.f.data(), c.t.data());
    if (shapeChange)
      eachGroup([&](const TieGroup& group, SegmentRange, TieGeometry shape, std::size_t) {
        distributeLoadsDerivative(group, shape, shapeChange, value, valueMoment, c.f.data());
      });
  };
  const auto inertial = [&](std::vector<double>& force, std::vector<double>& moment) {
    for (int s = 0; s < model.slaves(); ++s) at(force.data(), s) *= -mass[s];
    for (int s = 0; s < model.turning(); ++s) at(moment.data(), s) *= -inertia[s];
  };
  std::fill(c.f.begin(), c.f.end(), 0.0);
  std::fill(c.t.begin(), c.t.end(), 0.0);
  spread(c.load.data(), c.moment.data(), slaveLoad_, slaveMoment_);

  // Accelerations: seeds where driven, the equation of motion where free.
  double *da = a ? seed(Field::acceleration) : nullptr, *dz = seed(Field::angularAcceleration);
  if (model.anyFree()) {
    std::fill(da + first, da + last, 0.0);
    std::fill(dz + first, dz + turning, 0.0);
    if (consistent) {
      const double *vp = velocityFor(Field::predicted), *wp = spinFor(Field::predicted);
      slaveAccelerations(a, z, vp, wp);
      inertialLoads();
      differentiateAccelerations(c, da, dz, a, vp, wp, du, dturn, shapeChange);
      inertial(c.as, c.zs);
      const std::vector<double> f = c.f, t = c.t;
      spread(c.as.data(), c.zs.data(), as_.data(), zs_.data());
      for (int k = first; k < last; ++k) c.f[k] += c.node[k];
      for (int k = first; k < turning; ++k) c.t[k] += c.nodeMoment[k];
      inertia_->solve(c.f.data() + first, c.t.data() + first, da + first, dz + first);
      c.f = f;
      c.t = t;
    } else {
      const double *addedMass = field(Field::addedMass), *addedInertia = field(Field::addedInertia);
      for (int i = model.freeBegin(); i < model.freeEnd(); ++i)
        at(da, i) = (at(c.node.data(), i) + at(c.f.data(), i)) / (model.nodeMass[i] + addedMass[i]);
      for (int i = model.freeBegin(); i < model.rotating(); ++i)
        at(dz, i) = (at(c.nodeMoment.data(), i) + at(c.t.data(), i)) / (model.nodeInertia[i] + addedInertia[i]);
    }
  }

  // T q'' + b into c.as, c.zs and reactions into c.f, c.t
  const bool full = model.settings.reaction != Reaction::loads, split = model.settings.reaction == Reaction::split;
  if ((full && consistent) || has(Field::slaveAcceleration)) {
    std::fill(c.as.begin(), c.as.end(), 0.0);
    std::fill(c.zs.begin(), c.zs.end(), 0.0);
    differentiateAccelerations(c, da, dz, a, v, w, du, dturn, shapeChange);
  }
  if (full && consistent) {
    slaveAccelerations(a, z, v, w);
    inertialLoads();
    c.other = c.as;
    c.otherTurn = c.zs;
    inertial(c.other, c.otherTurn);
    spread(c.other.data(), c.otherTurn.data(), as_.data(), zs_.data());
  }
  if (full && (!consistent || split)) {
    const double sign = split ? 1 : -1;
    for (int i = 0; i < model.nodes(); ++i) at(c.f.data(), i) += sign * field(Field::addedMass)[i] * at(da, i);
    for (int i = 0; i < model.rotating(); ++i) at(c.t.data(), i) += sign * field(Field::addedInertia)[i] * at(dz, i);
  }

  // Outputs in the order of their fields. Each has its branch: one without does not compile.
  double *vs = seed(Field::slaveVelocity), *ws = seed(Field::slaveSpin);
  forEachField([&](auto constant) {
    constexpr Field f = constant;
    if (!has(f)) return;
    double* out = seed(f);
    if constexpr (f == Field::slaveVelocity) {
      eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
        mapMotion(group, range, shape, du, dturn, vs, ws);
        if (shapeChange) mapMotionDerivative(group, shape, shapeChange, v, vs, ws);
      });
    } else if constexpr (f == Field::slaveSpin) {
      // with the velocities
    } else if constexpr (f == Field::reactionForce) {
      std::copy(c.f.begin(), c.f.end(), out);
    } else if constexpr (f == Field::reactionMoment) {
      std::copy(c.t.begin(), c.t.end(), out);
    } else if constexpr (f == Field::slavePosition) {
      std::copy(c.xs.begin(), c.xs.end(), out);
    } else if constexpr (f == Field::slaveAcceleration) {
      std::copy(c.as.begin(), c.as.end(), out);
    } else if constexpr (f == Field::portReaction) {
      ports.gather(c.f.data(), c.t.data(), out, seed(Field::portReactionMoment));
      if (!model.springs.empty())
        ports.gather(c.node.data(), c.nodeMoment.data(), out, seed(Field::portReactionMoment));
    } else if constexpr (f == Field::portReactionMoment) {
      // with the forces
    } else if constexpr (f == Field::portMeanVelocity) {
      ports.mapMotion(vs, ws, out, seed(Field::portMeanSpin));
    } else if constexpr (f == Field::portMeanSpin) {
      // with the velocities
    } else if constexpr (f == Field::energy) {
      double kinetic = 0;
      for (int s = 0; s < model.slaves(); ++s) kinetic += mass[s] * at(field(Field::slaveVelocity), s).dot(at(vs, s));
      for (int s = 0; s < model.turning(); ++s) kinetic += inertia[s] * at(field(Field::slaveSpin), s).dot(at(ws, s));
      out[Energy::kinetic] = kinetic;
      out[Energy::strain] = strain;
      out[Energy::dissipated] = out[Energy::external] = 0;  // sums over time
      out[Energy::residual] = kinetic + strain;
    } else if constexpr (f == Field::powerResidual) {
      const auto change = [&](int count, const double* p, const double* q, const double* dp, const double* dq) {
        double part = 0;
        for (int i = 0; i < count; ++i) part += at(dp, i).dot(at(q, i)) + at(p, i).dot(at(dq, i));
        return part;
      };
      *out = 0;
      *out += change(model.slaves(), slaveLoad_, field(Field::slaveVelocity), c.load.data(), vs);
      *out += change(model.turning(), slaveMoment_, field(Field::slaveSpin), c.moment.data(), ws);
      *out -= change(model.nodes(), field(Field::reactionForce), v, c.f.data(), du);
      *out -= change(model.rotating(), field(Field::reactionMoment), w, c.t.data(), dturn);
    } else if constexpr (f == Field::portPosition || f == Field::drift) {
      // states: `out` stays zero
    } else if constexpr (f == Field::stableTimeStep || f == Field::nodalTimeStep) {
      // these follow from states and parameters
    } else {
      static_assert(rowOf(f).role != Role::output, "state how this output changes with the inputs");
    }
  });
}

}  // namespace tiefmu
