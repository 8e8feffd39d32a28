#include "dynamics.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <system_error>

namespace tiefmu {
namespace {

void fill(double* to, std::size_t count, const std::vector<double>& from) { std::copy_n(from.begin(), count, to); }

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

// dq/dt = (0, w) q / 2
void quaternionRate(const double* q, const Vec3& w, double* rate) {
  const Quat r = Quat(0, 0.5 * w.x(), 0.5 * w.y(), 0.5 * w.z()) * Quat(q[0], q[1], q[2], q[3]);
  rate[0] = r.w();
  rate[1] = r.x();
  rate[2] = r.y();
  rate[3] = r.z();
}

}  // namespace

Dynamics::Dynamics(const Model& m, const Layout& l, double* d) : model(m), layout(l), data(d), ports(m, l, d) {
  const std::size_t n = model.nodes(), r = model.rotating(), s = model.slaves(), u = model.turning();
  for (const TieGroup& group : model.groups) {
    firstFrame_.push_back(frames_.size());
    if (group.coupling == Coupling::meanMotion) frames_.resize(frames_.size() + group.segments());
  }
  inverseLength2_.resize(u);
  for (std::size_t j = 0; j < u; ++j) {
    const double length2 = at(model.slaveOffset.data(), j).squaredNorm();
    inverseLength2_[j] = length2 > 0 ? 1 / length2 : 0;
    offsetsTurn_ |= model.finite() && length2 > 0;
  }
  const bool springs = !model.springs.empty(), energy = has(Field::energy);
  const bool consistent = model.settings.inertia == Inertia::consistent;
  gravity_ = !model.settings.gravity.isZero(0);
  knownAccelerations_ = model.accelerationInputs() && model.anyDriven();
  bias_ = model.finite() && u > 0;
  drivenMove_ = model.settings.position == Position::integrated;

  std::vector<std::uint8_t> holds(s, 0);
  for (const Spring& spring : model.springs)
    for (const SpringEnd* end : {&spring.a, &spring.b})
      if (end->slave >= 0) holds[end->slave] = 1;
  for (const Port& port : model.ports)
    if (port.ofSlaves)
      for (int slave : port.member) holds[slave] = 1;
  for (int g = 0; g < static_cast<int>(model.groups.size()); ++g) {
    const TieGroup& group = model.groups[g];
    for (int e = 0; e < group.segments(); ++e) {
      const auto* first = holds.data() + group.firstSlave;
      if (std::none_of(first + group.begin[e], first + group.begin[e + 1], [](auto h) { return h; })) continue;
      if (!sprung_.empty() && sprung_.back().group == g && sprung_.back().range.last == e)
        ++sprung_.back().range.last;
      else
        sprung_.push_back({g, {e, e + 1}});
    }
  }
  if (springs || gravity_ || ports.anyOfSlaves()) {
    load_.resize(3 * s);
    moment_.resize(3 * u);
  }
  if (springs || energy || gravity_) {
    nodeLoad_.resize(3 * n);
    nodeMoment_.resize(3 * r);
  }
  if (springs || energy || model.anyFree()) {
    step_.resize(3 * n);
    stepSpin_.resize(3 * r);
  }
  const bool small = has(Field::position) && !model.finite();
  const bool stages = model.settings.method == Method::rk4 && model.anyFree();
  if (springs || energy || stages || small || ports.anyOfSlaves()) {
    vs_.resize(3 * s);
    ws_.resize(3 * u);
  }
  if (springs || ports.anyOfSlaves()) xs_.resize(3 * s);
  if (springs) {
    tangent_.resize(3 * s);
    tangentMoment_.resize(3 * u);
  }
  if (consistent || energy || has(Field::slaveAcceleration)) {
    as_.resize(3 * s);
    zs_.resize(3 * u);
    right_.resize(3 * n);
    rightMoment_.resize(3 * r);
  }
  if (small) displacement_.resize(3 * n);
  if (consistent && model.anyFree()) inertia_ = ConsistentInertia::of(model);
}

TieGeometry Dynamics::geometry(std::size_t g) const {
  // Offsets of translation couplings never turn, so they have no place in the state.
  const bool turning = model.groups[g].coupling != Coupling::translation;
  return {turning ? data + layout[Field::offset].offset : model.slaveOffset.data(), frames_.data() + firstFrame_[g]};
}

void Dynamics::setStart() {
  std::fill(data, data + layout.size, 0.0);
  *field(Field::timeStep) = model.settings.timeStep;
  *field(Field::safety) = model.settings.safety;
  *field(Field::threads) = std::max(1, model.settings.threads);
  pool_.reset();
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

void Dynamics::startThreads() {
  const double threads = *field(Field::threads);
  if (!(threads >= 1 && threads <= mostThreads && threads == std::floor(threads)))
    throw SceneError("integrator.threads is " + number(threads) + "; it must be a whole number from 1 to " +
                     std::to_string(mostThreads));
  const int wanted = model.shareable() ? static_cast<int>(threads) : 1;
  if (wanted == (pool_ ? pool_->threads() : 1)) return;
  pool_.reset();
  if (wanted == 1) return;
  try {
    pool_ = std::make_unique<ThreadPool>(wanted);
  } catch (const std::system_error& e) {
    throw SceneError("integrator.threads is " + number(threads) + ", more than the system gives: " + e.what());
  }
}

void Dynamics::prepare() {
  startThreads();
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
  if (!model.finite())
    eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry, std::size_t g) {
      if (group.coupling == Coupling::meanMotion)
        if (!updateFrames(group, range, model.nodePosition.data(), frames_.data() + firstFrame_[g]))
          noneCollapsed_ = false;
    });
  updateGeometry();
  if (inertia_) updateInertia();
}

void Dynamics::updateMass() {
  if (inertia_ && !inertia_->constant()) updateInertia();
}

void Dynamics::updateInertia() {
  inertia_->update(model.nodeMass.data(), model.nodeInertia.data(), field(Field::slaveMass), field(Field::slaveInertia),
                   field(Field::offset), frames_);
}

void Dynamics::updateGeometry() {
  if (!model.finite()) return;
  eachPart([&](const TieGroup& group, SegmentRange range, TieGeometry, std::size_t g) {
    if (group.coupling != Coupling::meanMotion) return;
    if (has(Field::position) && !updateFrames(group, range, field(Field::position), frames_.data() + firstFrame_[g]))
      noneCollapsed_ = false;
    if (has(Field::segmentRotation))
      rotateOffsets(group, range, field(Field::segmentRotation) + 4 * firstFrame_[g], model.slaveOffset.data(),
                    field(Field::offset));
  });
}

std::string Dynamics::findCollapsedSegment() {
  if (noneCollapsed_) return {};
  std::size_t k = 0;
  const double* rotation = has(Field::segmentRotation) ? data + layout[Field::segmentRotation].offset : nullptr;
  for (const TieGroup& group : model.groups) {
    if (group.coupling != Coupling::meanMotion) continue;
    for (int e = 0; e < group.segments(); ++e, ++k) {
      const double* m = frames_[k].inverse;
      double sum = m[0] + m[1] + m[2] + m[4] + m[5] + m[8];
      if (rotation) sum += rotation[4 * k] + rotation[4 * k + 1] + rotation[4 * k + 2] + rotation[4 * k + 3];
      if (std::isfinite(sum)) continue;
      std::string ids;
      for (int i = 0; i < group.corners; ++i)
        ids += (i ? ", " : "") + std::to_string(model.nodeId[group.node[group.corners * e + i]]);
      return ids;
    }
  }
  noneCollapsed_ = true;
  return {};
}

// Positions of the slaves that hold springs. In small displacements they are what the frozen T makes of the nodes'.
void Dynamics::placeSlaves(double* xs, bool sprungOnly) {
  const double* x = field(Field::position);
  if (!model.finite())
    for (std::size_t k = 0; k < displacement_.size(); ++k) displacement_[k] = x[k] - model.nodePosition[k];
  const auto body = [&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    if (model.finite()) return place(group, range, shape, x, xs);
    // x_s = X_s + T (x - X): the start position, then the displacement on top.
    mapMotion(group, range, shape, displacement_.data(), field(Field::angle), vs_.data(), ws_.data());
    place(group, range, shape, model.nodePosition.data(), xs);
    for (int k = 3 * (group.firstSlave + group.begin[range.first]);
         k < 3 * (group.firstSlave + group.begin[range.last]); ++k)
      xs[k] += vs_[k];
  };
  if (sprungOnly)
    eachSprung(body);
  else
    eachPart(body);
}

const double* Dynamics::quaternion(int index) const {
  const std::size_t segments = frames_.size();
  const std::size_t k = static_cast<std::size_t>(index);
  return k < segments ? data + layout[Field::segmentRotation].offset + 4 * k
                      : data + layout[Field::orientation].offset + 4 * (k - segments);
}

EndMotion Dynamics::motion(const SpringEnd& end, const Spring& spring, const double* v, const double* w) const {
  EndMotion m;
  if (end.node >= 0) {
    m.x = at(data + layout[Field::position].offset, end.node);
    m.v = at(v, end.node);
    if (end.node < model.rotating()) m.w = at(w, end.node);
  } else if (end.slave >= 0) {
    m.x = at(xs_.data(), end.slave);
    m.v = at(vs_.data(), end.slave);
    if (end.slave < model.turning()) m.w = at(ws_.data(), end.slave);
  } else {
    m.x = spring.anchor;
  }
  if (end.orientation >= 0) {
    const double* q = quaternion(end.orientation);
    m.q = Quat(q[0], q[1], q[2], q[3]);
  }
  return m;
}

// A moment on an end that cannot turn is lost (compile warned of it).
void Dynamics::addTo(const SpringEnd& end, const Vec3& force, const Vec3& moment, double* f, double* t, double* fs,
                     double* ms) const {
  if (end.node >= 0) {
    at(f, end.node) += force;
    if (end.node < model.rotating()) at(t, end.node) += moment;
  } else if (end.slave >= 0) {
    at(fs, end.slave) += force;
    if (end.slave < model.turning()) at(ms, end.slave) += moment;
  }
}

void Dynamics::gatherLoads() {
  const double *force = field(Field::slaveForce), *moment = field(Field::slaveMoment);
  slaveLoad_ = force;
  slaveMoment_ = moment;
  loadOnNodes_ = field(Field::nodeForce);
  momentOnNodes_ = field(Field::nodeMoment);
  strain_ = dissipation_ = turnRate_ = 0;
  if (!nodeLoad_.empty()) {
    loadOnNodes_ = nodeLoad_.data();
    momentOnNodes_ = nodeMoment_.data();
    std::fill(nodeLoad_.begin(), nodeLoad_.end(), 0.0);
    std::fill(nodeMoment_.begin(), nodeMoment_.end(), 0.0);
    const Vec3& g = model.settings.gravity;
    for (int i = model.freeBegin(); i < model.freeEnd(); ++i)
      at(nodeLoad_.data(), i) = at(field(Field::nodeForce), i) + model.nodeMass[i] * g;
    for (int i = model.freeBegin(); i < model.rotating(); ++i)
      at(nodeMoment_.data(), i) = at(field(Field::nodeMoment), i);
  }
  if (load_.empty()) return;
  std::copy_n(force, load_.size(), load_.begin());
  std::copy_n(moment, moment_.size(), moment_.begin());
  slaveLoad_ = load_.data();
  slaveMoment_ = moment_.data();
  if (gravity_)
    for (int s = 0; s < model.slaves(); ++s) at(load_.data(), s) += field(Field::slaveMass)[s] * model.settings.gravity;
  if (xs_.empty()) return;
  if (has(Field::position)) placeSlaves(xs_.data(), true);
  if (ports.anyOfSlaves()) {
    ports.shape(xs_.data(), [&](int k) { return quaternion(k); });
    ports.distributeLoads(field(Field::portForce), field(Field::portMoment), load_.data(), moment_.data());
  }
  if (model.springs.empty()) return;
  const double *v = velocityFor(Field::lagged), *w = spinFor(Field::lagged);
  eachSprung([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    mapMotion(group, range, shape, v, w, vs_.data(), ws_.data());
  });
  double rate2 = 0;
  for (const Spring& spring : model.springs) {
    const EndMotion a = motion(spring.a, spring, v, w), b = motion(spring.b, spring, v, w);
    const SpringLoad l = springLoad(spring, a, b);
    rate2 = std::max({rate2, a.w.squaredNorm(), b.w.squaredNorm()});
    if (spring.kind == SpringKind::axial && spring.stiffness[0] > 0)
      rate2 = std::max(rate2, (a.v - b.v).squaredNorm() / std::max((a.x - b.x).squaredNorm(), 1e-300));
    addTo(spring.a, l.fa, l.ta, nodeLoad_.data(), nodeMoment_.data(), load_.data(), moment_.data());
    addTo(spring.b, l.fb, l.tb, nodeLoad_.data(), nodeMoment_.data(), load_.data(), moment_.data());
    strain_ += l.energy;
    dissipation_ += l.dissipation;
  }
  turnRate_ = std::sqrt(rate2);
}

void Dynamics::updateTurnRate(const double* v, const double* w) {
  double rate2 = turnRate_ * turnRate_;
  for (int i = model.freeBegin(); i < model.rotating(); ++i) rate2 = std::max(rate2, at(w, i).squaredNorm());
  eachGroup([&](const TieGroup& group, SegmentRange, TieGeometry shape, std::size_t) {
    if (group.coupling != Coupling::meanMotion) return;
    for (int e = 0; e < group.segments(); ++e) {
      Vec3 spin;
      meanSpin(group, {e, e + 1}, shape.frame, v, spin.data() - 3 * static_cast<std::ptrdiff_t>(e));
      rate2 = std::max(rate2, spin.squaredNorm());
    }
  });
  turnRate_ = std::sqrt(rate2);
}

void Dynamics::distributeAll(const double* force, const double* moment, double* f, double* t) {
  for (std::size_t g = 0; g < model.groups.size(); ++g) {
    const TieGroup& group = model.groups[g];
    const auto part = [&](int first, int last) {
      distributeLoads(group, {first, last}, geometry(g), force, moment, f, t);
    };
    if (!pool_) {
      part(0, group.segments());
      continue;
    }
    // Parts touch no common node, so that the sums do not depend on who is first; the border comes after all of them.
    const std::vector<int>& end = group.partEnd;
    pool_->each(static_cast<int>(end.size()), [&](int k) { part(k == 0 ? 0 : end[k - 1], end[k]); });
    part(end.back(), group.segments());
  }
}

void Dynamics::evaluateReactions() {
  gatherLoads();
  if (hasBias()) updateTurnRate(velocityFor(Field::predicted), spinFor(Field::predicted));
  static_assert(adjacent(Field::reactionForce, Field::reactionMoment));
  const Slice reactions = layout.through(Field::reactionForce, Field::reactionMoment);
  eachBlock(reactions.count, [&](std::size_t first, std::size_t last) {
    std::fill(data + reactions.offset + first, data + reactions.offset + last, 0.0);
  });
  distributeAll(slaveLoad_, slaveMoment_, field(Field::reactionForce), field(Field::reactionMoment));
}

// a_s = T q'' + b into as_, zs_.
void Dynamics::slaveAccelerations(const double* a, const double* z, const double* v, const double* w) {
  eachPart([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    mapMotion(group, range, shape, a, z, as_.data(), zs_.data());
    if (bias_) addBias(group, range, shape, v, w, as_.data(), zs_.data());
  });
}

void Dynamics::evaluate() {
  ++evaluations;
  evaluateReactions();
  const int first = model.freeBegin(), last = model.freeEnd(), turning = model.rotating();
  const double *f = field(Field::reactionForce), *t = field(Field::reactionMoment);
  double *a = field(Field::acceleration), *z = field(Field::angularAcceleration);
  if (!inertia_) {
    const double *mass = field(Field::addedMass), *inertia = field(Field::addedInertia);
    eachBlock(last - first, [&](std::size_t i, std::size_t end) {
      i += first;
      end += first;
      accelerate(end - i, loadOnNodes_ + 3 * i, f + 3 * i, &model.nodeMass[i], mass + i, a + 3 * i);
    });
    eachBlock(turning - first, [&](std::size_t i, std::size_t end) {
      i += first;
      end += first;
      accelerate(end - i, momentOnNodes_ + 3 * i, t + 3 * i, &model.nodeInertia[i], inertia + i, z + 3 * i);
    });
    return;
  }
  updateMass();
  std::copy_n(f, right_.size(), right_.begin());
  std::copy_n(t, rightMoment_.size(), rightMoment_.begin());
  if (bias_ || knownAccelerations_) {
    // What is known of the slaves' acceleration: that of the driven masters, and the bias.
    std::copy_n(a, step_.size(), step_.begin());
    std::copy_n(z, stepSpin_.size(), stepSpin_.begin());
    std::fill(step_.begin() + 3 * first, step_.begin() + 3 * last, 0.0);
    std::fill(stepSpin_.begin() + 3 * first, stepSpin_.end(), 0.0);
    slaveAccelerations(step_.data(), stepSpin_.data(), velocityFor(Field::predicted), spinFor(Field::predicted));
    inertialLoads();
    distributeAll(as_.data(), zs_.data(), right_.data(), rightMoment_.data());
  }
  for (int i = 3 * first; i < 3 * last; ++i) right_[i] += loadOnNodes_[i];
  for (int i = 3 * first; i < 3 * turning; ++i) rightMoment_[i] += momentOnNodes_[i];
  inertia_->solve(right_.data() + 3 * first, rightMoment_.data() + 3 * first, a + 3 * first, z + 3 * first);
}

// (as_, zs_) from accelerations to -m_s a_s, -I_s z_s.
void Dynamics::inertialLoads() {
  const double *mass = field(Field::slaveMass), *inertia = field(Field::slaveInertia);
  for (int s = 0; s < model.slaves(); ++s) at(as_.data(), s) *= -mass[s];
  for (int s = 0; s < model.turning(); ++s) at(zs_.data(), s) *= -inertia[s];
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

void Dynamics::inputsOver(double tau, double h) {
  if (inputs.active()) inputs.over(tau, h, data);
  if (ports.anyDriven()) ports.carry(inputs, tau, h);
}

void Dynamics::inputsAt(double tau, double h) {
  if (inputs.active()) {
    inputs.at(tau + h, data);
    if (!drivenMove_) updateGeometry();
  }
  if (ports.anyDriven()) ports.advance(inputs, tau, h);
}

void Dynamics::movePorts() {
  ports.move();
  takeDrivenVelocities();
}

// value += h rate
void Dynamics::advance(std::size_t count, double h, const double* rate, double* value) {
  eachBlock(count,
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
  if (!model.oriented.empty()) {
    // Only rotation couplings are tracked here, whose spin does not depend on the geometry.
    eachSprung([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
      mapMotion(group, range, shape, v, w, vs_.data(), ws_.data());
    });
    for (std::size_t k = 0; k < model.oriented.size(); ++k) {
      const SpringEnd& end = model.oriented[k];
      turnQuaternion(field(Field::orientation) + 4 * k,
                     h * (end.node >= 0 ? Vec3(at(w, end.node)) : Vec3(at(ws_.data(), end.slave))));
    }
  }
  const bool turns = has(Field::segmentRotation);
  eachPart([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t g) {
    if (group.coupling == Coupling::rotation && offsetsTurn_)
      turnOffsets(group, range, h, w, inverseLength2_.data(), field(Field::offset));
    if (group.coupling != Coupling::meanMotion) return;
    double* q = turns ? field(Field::segmentRotation) + 4 * firstFrame_[g] : nullptr;
    if (model.finite()) {
      if (!moveSegments(group, range, h, field(Field::position), v, frames_.data() + firstFrame_[g], q))
        noneCollapsed_ = false;
      if (turns) rotateOffsets(group, range, q, model.slaveOffset.data(), field(Field::offset));
    } else if (turns) {
      for (int e = range.first; e < range.last; ++e) {
        Vec3 spin;
        meanSpin(group, {e, e + 1}, shape.frame, v, spin.data() - 3 * static_cast<std::ptrdiff_t>(e));
        turnQuaternion(q + 4 * static_cast<std::ptrdiff_t>(e), h * spin);
      }
    }
  });
  advance(layout[Field::angle].count, h, w, field(Field::angle));
  if (!has(Field::position)) return;
  double* x = field(Field::position);
  if (drivenMove_) {
    advance(3 * model.nodes(), h, v, x);
  } else {  // driven positions that are inputs stay as they were set
    advance(3 * model.free(), h, v + 3 * model.freeBegin(), x + 3 * model.freeBegin());
    updateGeometry();
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
    if (drivenMove_)
      std::copy_n(v, layout[Field::position].count, of(Field::position));
    else
      std::copy(v + 3 * model.freeBegin(), v + 3 * model.freeEnd(), of(Field::position) + 3 * model.freeBegin());
  }
  std::copy_n(w, layout[Field::angle].count, of(Field::angle));
  if (offsetsTurn_ || !model.oriented.empty())
    eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
      if (group.coupling != Coupling::rotation) return;
      mapMotion(group, range, shape, v, w, vs_.data(), ws_.data());
      if (!offsetsTurn_) return;
      for (int s = group.firstSlave; s < group.firstSlave + group.slaves(); ++s)
        at(of(Field::offset), s) = at(ws_.data(), s).cross(at(shape.offset, s));
    });
  if (has(Field::segmentRotation))
    eachGroup([&](const TieGroup& group, SegmentRange, TieGeometry shape, std::size_t g) {
      if (group.coupling != Coupling::meanMotion) return;
      for (int e = 0; e < group.segments(); ++e) {
        Vec3 spin;
        meanSpin(group, {e, e + 1}, shape.frame, v, spin.data() - 3 * static_cast<std::ptrdiff_t>(e));
        const std::size_t k = 4 * (firstFrame_[g] + e);
        quaternionRate(field(Field::segmentRotation) + k, spin, of(Field::segmentRotation) + k);
      }
    });
  for (std::size_t k = 0; k < model.oriented.size(); ++k) {
    const SpringEnd& end = model.oriented[k];
    quaternionRate(field(Field::orientation) + 4 * k,
                   end.node >= 0 ? Vec3(at(w, end.node)) : Vec3(at(ws_.data(), end.slave)),
                   of(Field::orientation) + 4 * k);
  }
  if (has(Field::work)) {
    const Power p = power();
    of(Field::work)[Work::external] = p.external;
    of(Field::work)[Work::dissipated] = p.dissipated;
  }
}

void Dynamics::normalise() {
  for (Field f : {Field::segmentRotation, Field::orientation})
    for (std::size_t k = 0; k < layout[f].count; k += 4) Eigen::Map<Eigen::Vector4d>(field(f) + k).normalize();
  if (!offsetsTurn_) return;
  for (const TieGroup& group : model.groups) {
    if (group.coupling != Coupling::rotation) continue;
    for (int s = group.firstSlave; s < group.firstSlave + group.slaves(); ++s)
      if (inverseLength2_[s] > 0)
        at(field(Field::offset), s) /= std::sqrt(at(field(Field::offset), s).squaredNorm() * inverseLength2_[s]);
  }
}

void Dynamics::updateOutputs() {
  const double *v = field(Field::velocity), *w = field(Field::spin);
  const double *a = field(Field::acceleration), *z = field(Field::angularAcceleration);
  double *f = field(Field::reactionForce), *t = field(Field::reactionMoment);
  eachPart([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    mapMotion(group, range, shape, v, w, field(Field::slaveVelocity), field(Field::slaveSpin));
  });
  const bool consistent = model.settings.inertia == Inertia::consistent;
  const bool inertial = consistent && model.settings.reaction != Reaction::loads;
  if (inertial || has(Field::slaveAcceleration)) slaveAccelerations(a, z, v, w);
  if (has(Field::slaveAcceleration)) std::copy(as_.begin(), as_.end(), field(Field::slaveAcceleration));
  if (model.settings.reaction != Reaction::loads) {
    std::fill_n(f, layout[Field::reactionForce].count, 0.0);
    std::fill_n(t, layout[Field::reactionMoment].count, 0.0);
    distributeAll(slaveLoad_, slaveMoment_, f, t);
    const bool split = model.settings.reaction == Reaction::split;
    if (inertial) {
      inertialLoads();
      distributeAll(as_.data(), zs_.data(), f, t);
    }
    // full, lumped: - D a. split: + D a.
    if (!consistent || split) {
      const double sign = split ? 1 : -1;
      for (int i = 0; i < model.nodes(); ++i) at(f, i) += sign * field(Field::addedMass)[i] * at(a, i);
      for (int i = 0; i < model.rotating(); ++i) at(t, i) += sign * field(Field::addedInertia)[i] * at(z, i);
    }
  }
  if (has(Field::slavePosition)) placeSlaves(field(Field::slavePosition), false);
  if (ports.anyDriven()) {
    double *force = field(Field::portReaction), *moment = field(Field::portReactionMoment);
    std::fill_n(force, layout[Field::portReaction].count, 0.0);
    std::fill_n(moment, layout[Field::portReactionMoment].count, 0.0);
    ports.gather(f, t, force, moment);
    if (!model.springs.empty()) ports.gather(nodeLoad_.data(), nodeMoment_.data(), force, moment);
  }
  if (ports.anyOfSlaves())
    ports.mapMotion(field(Field::slaveVelocity), field(Field::slaveSpin), field(Field::portMeanVelocity),
                    field(Field::portMeanSpin));
  if (has(Field::portPosition)) ports.places(xs_.data(), field(Field::portPosition));
  if (has(Field::energy)) {
    const double* work = field(Field::work);
    double* e = field(Field::energy);
    e[Energy::kinetic] = kineticEnergy();
    e[Energy::strain] = strain_;
    e[Energy::dissipated] = work[Work::dissipated];
    e[Energy::external] = work[Work::external];
    e[Energy::residual] =
        e[Energy::kinetic] + e[Energy::strain] + e[Energy::dissipated] - e[Energy::external] - work[Work::totalAtStart];
  }
  if (has(Field::powerResidual)) {
    double sum = 0;
    for (int s = 0; s < model.slaves(); ++s) sum += at(slaveLoad_, s).dot(at(field(Field::slaveVelocity), s));
    for (int s = 0; s < model.turning(); ++s) sum += at(slaveMoment_, s).dot(at(field(Field::slaveSpin), s));
    for (int i = 0; i < model.nodes(); ++i) sum -= at(f, i).dot(at(v, i));
    for (int i = 0; i < model.rotating(); ++i) sum -= at(t, i).dot(at(w, i));
    *field(Field::powerResidual) = sum;
  }
  if (has(Field::drift)) {
    double worst = 0;
    for (int s = 0; s < model.turning(); ++s)
      worst = std::max(worst, std::abs(at(field(Field::offset), s).norm() - at(model.slaveOffset.data(), s).norm()));
    *field(Field::drift) = worst;
  }
}

double Dynamics::kineticEnergy() {
  const double *v = field(Field::velocity), *w = field(Field::spin);
  eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    mapMotion(group, range, shape, v, w, vs_.data(), ws_.data());
  });
  double twice = 0;
  for (int i = model.freeBegin(); i < model.freeEnd(); ++i) twice += model.nodeMass[i] * at(v, i).squaredNorm();
  for (int i = model.freeBegin(); i < model.rotating(); ++i) twice += model.nodeInertia[i] * at(w, i).squaredNorm();
  for (int s = 0; s < model.slaves(); ++s) twice += field(Field::slaveMass)[s] * at(vs_.data(), s).squaredNorm();
  for (int s = 0; s < model.turning(); ++s) twice += field(Field::slaveInertia)[s] * at(ws_.data(), s).squaredNorm();
  return 0.5 * twice;
}

Dynamics::Power Dynamics::power() {
  Power p{0, dissipation_};
  const double *v = field(Field::velocity), *w = field(Field::spin);
  const Vec3& g = model.settings.gravity;
  for (int i = model.freeBegin(); i < model.freeEnd(); ++i)
    p.external += (at(field(Field::nodeForce), i) + model.nodeMass[i] * g).dot(at(v, i));
  for (int i = model.freeBegin(); i < model.rotating(); ++i)
    p.external += at(field(Field::nodeMoment), i).dot(at(w, i));
  eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    mapMotion(group, range, shape, v, w, vs_.data(), ws_.data());
  });
  for (int s = 0; s < model.slaves(); ++s)
    p.external += (at(field(Field::slaveForce), s) + field(Field::slaveMass)[s] * g).dot(at(vs_.data(), s));
  for (int s = 0; s < model.turning(); ++s) p.external += at(field(Field::slaveMoment), s).dot(at(ws_.data(), s));
  if (ports.anyOfSlaves()) p.external += ports.power(vs_.data(), ws_.data());
  if (!model.anyDriven()) return p;
  // The driven nodes' part: what holds them against springs and tie, inertia included.
  std::fill(right_.begin(), right_.end(), 0.0);
  std::fill(rightMoment_.begin(), rightMoment_.end(), 0.0);
  if (has(Field::acceleration)) {
    slaveAccelerations(field(Field::acceleration), field(Field::angularAcceleration), v, w);
  } else {
    std::fill(as_.begin(), as_.end(), 0.0);
    std::fill(zs_.begin(), zs_.end(), 0.0);
    if (bias_)
      eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
        addBias(group, range, shape, v, w, as_.data(), zs_.data());
      });
  }
  inertialLoads();
  distributeAll(as_.data(), zs_.data(), right_.data(), rightMoment_.data());
  distributeAll(slaveLoad_, slaveMoment_, right_.data(), rightMoment_.data());
  for (int i = 0; i < model.nodes(); ++i) {
    if (i >= model.freeBegin() && i < model.freeEnd()) continue;
    p.external -= (at(right_.data(), i) + at(nodeLoad_.data(), i)).dot(at(v, i));
    if (i < model.rotating()) p.external -= (at(rightMoment_.data(), i) + at(nodeMoment_.data(), i)).dot(at(w, i));
  }
  return p;
}

void Dynamics::springOperator(const double* u, const double* turn, double* f, double* t, bool damping) {
  std::fill_n(f, 3 * static_cast<std::size_t>(model.nodes()), 0.0);
  std::fill_n(t, 3 * static_cast<std::size_t>(model.rotating()), 0.0);
  std::fill(tangent_.begin(), tangent_.end(), 0.0);
  std::fill(tangentMoment_.begin(), tangentMoment_.end(), 0.0);
  placeSlaves(xs_.data(), true);
  eachSprung([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    mapMotion(group, range, shape, u, turn, vs_.data(), ws_.data());
  });
  for (const Spring& spring : model.springs) {
    const SpringLoad l =
        springTangent(spring, motion(spring.a, spring, u, turn), motion(spring.b, spring, u, turn), damping);
    addTo(spring.a, -l.fa, -l.ta, f, t, tangent_.data(), tangentMoment_.data());
    addTo(spring.b, -l.fb, -l.tb, f, t, tangent_.data(), tangentMoment_.data());
  }
  eachSprung([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    distributeLoads(group, range, shape, tangent_.data(), tangentMoment_.data(), f, t);
  });
}

void Dynamics::solveInertia(const double* f, const double* t, double* a, double* z) {
  const int first = model.freeBegin(), last = model.freeEnd(), turning = model.rotating();
  if (inertia_) return inertia_->solve(f + 3 * first, t + 3 * first, a + 3 * first, z + 3 * first);
  for (int i = first; i < last; ++i) at(a, i) = at(f, i) / (model.nodeMass[i] + field(Field::addedMass)[i]);
  for (int i = first; i < turning; ++i) at(z, i) = at(t, i) / (model.nodeInertia[i] + field(Field::addedInertia)[i]);
}

}  // namespace tiefmu
