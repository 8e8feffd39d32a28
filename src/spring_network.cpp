#include "spring_network.hpp"

#include <algorithm>
#include <cassert>

namespace tiefmu {

SpringNetwork::SpringNetwork(const Model& model, const Layout& layout, double* data, AttachedSlaves& slaves)
    : model_(model), layout_(layout), data_(data), slaves_(slaves) {
  for (const TieGroup& group : model.groups)
    if (kinematicsOf(group.coupling).segmentsTurn) segmentRotations_ += group.segments();
  if (empty()) return;
  slaveForce_.resize(3 * static_cast<std::size_t>(model.slaves()));
  slaveMoment_.resize(3 * static_cast<std::size_t>(model.turning()));
}

const double* SpringNetwork::rotation(int index) const {
  assert(index >= 0);
  const std::size_t k = static_cast<std::size_t>(index);
  return k < segmentRotations_ ? field(Field::segmentRotation) + 4 * k
                               : field(Field::orientation) + 4 * (k - segmentRotations_);
}

EndMotion SpringNetwork::motion(const SpringEnd& end, const Spring& spring, const double* v, const double* w) const {
  EndMotion m;
  if (end.node >= 0) {
    m.x = at(field(Field::position), end.node);
    m.v = at(v, end.node);
    if (end.node < model_.rotating()) m.w = at(w, end.node);
  } else if (end.slave >= 0) {
    m.x = at(slaves_.position(), end.slave);
    m.v = at(slaves_.velocity(), end.slave);
    if (end.slave < model_.turning()) m.w = at(slaves_.spin(), end.slave);
  } else {
    m.x = spring.anchor;
  }
  if (end.orientation >= 0) {
    const double* q = rotation(end.orientation);
    m.q = Quat(q[0], q[1], q[2], q[3]);
  }
  return m;
}

// A moment on an end that cannot turn is lost (compile warned of it).
void SpringNetwork::addTo(const SpringEnd& end, const Vec3& force, const Vec3& moment, const LoadArrays& to) const {
  if (end.node >= 0) {
    at(to.f, end.node) += force;
    if (end.node < model_.rotating()) at(to.t, end.node) += moment;
  } else if (end.slave >= 0) {
    at(to.fs, end.slave) += force;
    if (end.slave < model_.turning()) at(to.ms, end.slave) += moment;
  }
}

void SpringNetwork::addLoads(const double* v, const double* w, const LoadArrays& to) {
  assert(empty() || (to.f && to.fs && layout_[Field::position].count > 0));
  clear();
  slaves_.updateMotion(v, w);
  for (const Spring& spring : model_.springs) {
    const EndMotion a = motion(spring.a, spring, v, w), b = motion(spring.b, spring, v, w);
    const SpringLoad l = springLoad(spring, a, b);
    turnRate2_ = std::max({turnRate2_, a.w.squaredNorm(), b.w.squaredNorm()});
    if (spring.kind == SpringKind::axial && spring.stiffness[0] > 0)
      turnRate2_ = std::max(turnRate2_, (a.v - b.v).squaredNorm() / std::max((a.x - b.x).squaredNorm(), 1e-300));
    addTo(spring.a, l.fa, l.ta, to);
    addTo(spring.b, l.fb, l.tb, to);
    strain_ += l.energy;
    dissipation_ += l.dissipation;
  }
}

void SpringNetwork::applyTangent(const double* u, const double* turn, double* f, double* t, bool damping) {
  std::fill_n(f, 3 * static_cast<std::size_t>(model_.nodes()), 0.0);
  std::fill_n(t, 3 * static_cast<std::size_t>(model_.rotating()), 0.0);
  std::fill(slaveForce_.begin(), slaveForce_.end(), 0.0);
  std::fill(slaveMoment_.begin(), slaveMoment_.end(), 0.0);
  slaves_.updatePositions();
  slaves_.updateMotion(u, turn);
  const LoadArrays to{f, t, slaveForce_.data(), slaveMoment_.data()};
  for (const Spring& spring : model_.springs) {
    const SpringLoad l =
        springTangent(spring, motion(spring.a, spring, u, turn), motion(spring.b, spring, u, turn), damping);
    addTo(spring.a, -l.fa, -l.ta, to);
    addTo(spring.b, -l.fb, -l.tb, to);
  }
  slaves_.distributeLoads(slaveForce_.data(), slaveMoment_.data(), f, t);
}

void SpringNetwork::differentiate(Way way, const double* v, const double* w, const MotionArrays& motions,
                                  const LoadArrays& loads, double& strain) {
  slaves_.updatePositions();
  slaves_.updateMotion(v, w);
  struct Places { double *x = nullptr, *v = nullptr, *w = nullptr, *f = nullptr, *t = nullptr; };
  const auto placesOf = [&](const SpringEnd& end) {  // null: none
    Places p;
    const bool ofSlave = end.slave >= 0;
    if (end.node < 0 && !ofSlave) return p;
    const std::ptrdiff_t k = 3 * static_cast<std::ptrdiff_t>(ofSlave ? end.slave : end.node);
    if (motions.x) p.x = (ofSlave ? motions.xs : motions.x) + k;
    p.v = (ofSlave ? motions.vs : motions.v) + k;
    p.f = (ofSlave ? loads.fs : loads.f) + k;
    if (ofSlave ? end.slave >= model_.turning() : end.node >= model_.rotating()) return p;
    p.w = (ofSlave ? motions.ws : motions.w) + k;
    p.t = (ofSlave ? loads.ms : loads.t) + k;
    return p;
  };
  const auto read = [](const double* p) -> Vec3 { return p ? Vec3(at(p, 0)) : Vec3(0, 0, 0); };
  const auto add = [](const Vec3& value, double* p) {
    if (p) at(p, 0) += value;
  };
  for (const Spring& spring : model_.springs) {
    const SpringJacobian j = springJacobian(spring, motion(spring.a, spring, v, w), motion(spring.b, spring, v, w));
    const Places a = placesOf(spring.a), b = placesOf(spring.b);
    Eigen::Matrix<double, 12, 1> change;
    Eigen::Matrix<double, 9, 1> load;
    if (way == Way::forward) {
      change << read(a.x) - read(b.x), read(a.v) - read(b.v), read(a.w), read(b.w);
      load = j.loads * change;
      add(-load.head<3>(), a.f);
      add(load.head<3>(), b.f);
      add(load.segment<3>(3), a.t);
      add(load.tail<3>(), b.t);
      strain += j.energy.dot(change.head<3>());
    } else {
      load << read(b.f) - read(a.f), read(a.t), read(b.t);
      change = j.loads.transpose() * load;
      change.head<3>() += strain * j.energy;
      add(change.head<3>(), a.x);
      add(-change.head<3>(), b.x);
      add(change.segment<3>(3), a.v);
      add(-change.segment<3>(3), b.v);
      add(change.segment<3>(6), a.w);
      add(change.tail<3>(), b.w);
    }
  }
}

Vec3 SpringNetwork::spin(const SpringEnd& end, const double* w) const {
  return end.node >= 0 ? at(w, end.node) : at(slaves_.spin(), end.slave);
}

// Of the slaves only those of rotation couplings are tracked here, whose spin does not depend on the geometry.
void SpringNetwork::turnEnds(double h, const double* v, const double* w) {
  slaves_.updateMotion(v, w);
  for (std::size_t k = 0; k < model_.oriented.size(); ++k)
    turnQuaternion(field(Field::orientation) + 4 * k, h * spin(model_.oriented[k], w));
}

void SpringNetwork::endRates(const double* v, const double* w, double* rate) {
  slaves_.updateMotion(v, w);
  for (std::size_t k = 0; k < model_.oriented.size(); ++k)
    quaternionRate(field(Field::orientation) + 4 * k, spin(model_.oriented[k], w), rate + 4 * k);
}

}  // namespace tiefmu
