#include "port.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cassert>
#include <cmath>

#include "segment.hpp"

namespace tiefmu {
namespace {

// The rotation R with the largest trace of R^T H, by the eigenvector of Horn's matrix [Horn 1987]: for H = sum x x0^T
// the one that turns the x0 closest to the x.
Mat3 closestRotation(const Mat3& h) {
  const Vec3 axis(h(2, 1) - h(1, 2), h(0, 2) - h(2, 0), h(1, 0) - h(0, 1));
  Eigen::Matrix4d horn;
  horn(0, 0) = h.trace();
  horn.block<3, 1>(1, 0) = axis;
  horn.block<1, 3>(0, 1) = axis.transpose();
  horn.block<3, 3>(1, 1) = h + h.transpose() - h.trace() * Mat3::Identity();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(horn);
  const Eigen::Vector4d q = solver.eigenvectors().col(3);
  return Quat(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

}  // namespace

Mat3 armInertia(const std::vector<double>& arm) {
  assert(arm.size() % 3 == 0);
  Mat3 sum = Mat3::Zero();
  for (std::size_t i = 0; 3 * i < arm.size(); ++i) sum += unitInertia(at(arm.data(), i));
  return sum;
}

Ports::Ports(const Model& model, const Layout& layout, double* data)
    : model_(model), layout_(layout), data_(data), driven_(model.drivenPorts()) {
  if (driven_ > 0) moved_.resize(static_cast<std::size_t>(model.nodes()));
  for (const Port& port : model.ports) {
    if (!port.ofSlaves) {
      for (int node : port.member) moved_[node] = 1;
      continue;
    }
    Shape s;
    s.arm = port.arm;
    s.lever = port.lever;
    if (port.turnWeight > 0)
      s.turning = static_cast<int>(
          std::count_if(port.member.begin(), port.member.end(), [&](int slave) { return slave < model.turning(); }));
    shapes_.push_back(std::move(s));
    setShape(shapes_.size() - 1, nullptr);
  }
}

// J^-1, and the lever, from the arms as they are: turned as they have turned since the start.
void Ports::setShape(std::size_t k, const Mat3* turned) {
  const Port& port = slavePort(k);
  Shape& s = shapes_[k];
  s.inverse = inverseSymmetric(armInertia(s.arm) + s.turning * port.turnWeight * Mat3::Identity());
  if (!turned || port.lever.isZero(0)) return;
  Mat3 h = *turned;
  for (std::size_t i = 0; i < port.member.size(); ++i) h += at(s.arm.data(), i) * at(port.arm.data(), i).transpose();
  s.lever = closestRotation(h) * port.lever;
}

void Ports::setStart() {
  for (std::size_t p = 0; p < driven_; ++p) {
    at(field(Field::portPlace), p) = model_.ports[p].place;
    at(field(Field::portVelocity), p) = model_.ports[p].velocity;
    at(field(Field::portSpin), p) = model_.ports[p].spin;
    if (model_.finite()) field(Field::portRotation)[4 * p] = 1;
  }
}

Mat3 Ports::rotation(std::size_t p) const {
  if (!model_.finite()) return Mat3::Identity();
  const double* q = field(Field::portRotation) + 4 * p;
  return Quat(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

void Ports::move() {
  for (std::size_t p = 0; p < driven_; ++p) moveNodes(p, false);
}

void Ports::moveNodes(std::size_t p, bool places) {
  const Port& port = model_.ports[p];
  const Mat3 turned = rotation(p);
  const bool accelerations = model_.accelerationInputs();
  const Vec3 v = at(field(Field::portVelocity), p), w = at(field(Field::portSpin), p);
  const Vec3 place = at(field(Field::portPlace), p);
  Vec3 a = Vec3::Zero(), z = Vec3::Zero();
  if (accelerations) {
    a = at(field(Field::portAcceleration), p);
    z = at(field(Field::portAngularAcceleration), p);
  }
  for (std::size_t i = 0; i < port.member.size(); ++i) {
    const int node = port.member[i];
    const Vec3 r = turned * at(port.arm.data(), i), across = w.cross(r);
    if (places) at(field(Field::position), node) = place + r;
    at(field(Field::velocity), node) = v + across;
    if (accelerations)
      at(field(Field::acceleration), node) = a + z.cross(r) + (model_.finite() ? w.cross(across) : Vec3(0, 0, 0));
    if (node >= model_.rotating()) continue;
    at(field(Field::spin), node) = w;
    if (accelerations) at(field(Field::angularAcceleration), node) = z;
  }
}

// The rotation vector of a w(t) that moves is h w_mean - h^2/12 w(tau) x w(tau + h) to fourth order [Magnus 1954], and
// h w exactly where w stands.
Ports::Motion Ports::motion(const InputCurve& inputs, std::size_t p, double tau, double h) const {
  const std::size_t v = layout_[Field::portVelocity].offset + 3 * p, w = layout_[Field::portSpin].offset + 3 * p;
  if (!inputs.active()) return {h * at(data_ + v, 0), h * at(data_ + w, 0)};
  const Vec3 before = inputs.at(w, tau, data_), after = inputs.at(w, tau + h, data_);
  return {h * inputs.mean(v, tau, h, data_), h * inputs.mean(w, tau, h, data_) - h * h / 12 * before.cross(after)};
}

void Ports::carry(const InputCurve& inputs, double tau, double h) {
  for (std::size_t p = 0; p < driven_; ++p) {
    const Port& port = model_.ports[p];
    const auto [shift, turn] = motion(inputs, p, tau, h);
    const Mat3 turned = rotation(p);
    const Quat q = exponential(turn);
    const Vec3 axis = q.vec(), spin = turn / h, velocity = shift / h;
    for (std::size_t i = 0; i < port.member.size(); ++i) {
      const int node = port.member[i];
      const Vec3 r = turned * at(port.arm.data(), i);
      Vec3 travel = spin.cross(r);
      if (model_.finite()) {  // (exp(turn) - 1) r / h
        const Vec3 across = axis.cross(r);
        travel = 2 / h * (q.w() * across + axis.cross(across));
      }
      at(field(Field::velocity), node) = velocity + travel;
      if (node < model_.rotating()) at(field(Field::spin), node) = spin;
    }
  }
}

void Ports::advance(const InputCurve& inputs, double tau, double h) {
  for (std::size_t p = 0; p < driven_; ++p) {
    const auto [shift, turn] = motion(inputs, p, tau, h);
    at(field(Field::portPlace), p) += shift;
    if (model_.finite()) turnQuaternion(field(Field::portRotation) + 4 * p, turn);
    moveNodes(p, model_.finite() && layout_[Field::position].count > 0);
  }
}

void Ports::differentiateMotion(Way way, double* array) const {
  const auto of = [&](Field f) { return array + layout_[f].offset; };
  const auto rigid = [&](Field v, Field w, Field nodeV, Field nodeW) {
    if (way == Way::forward)
      spread(of(v), of(w), of(nodeV), of(nodeW));
    else
      gather(of(nodeV), of(nodeW), of(v), of(w));
  };
  rigid(Field::portVelocity, Field::portSpin, Field::velocity, Field::spin);
  if (!model_.accelerationInputs()) return;
  rigid(Field::portAcceleration, Field::portAngularAcceleration, Field::acceleration, Field::angularAcceleration);
  if (!model_.finite()) return;
  for (std::size_t p = 0; p < driven_; ++p) {
    const Port& port = model_.ports[p];
    const Mat3 turned = rotation(p);
    const Vec3 w = at(field(Field::portSpin), p);
    MapVec3 change = at(of(Field::portSpin), p);
    for (std::size_t i = 0; i < port.member.size(); ++i) {
      const Vec3 r = turned * at(port.arm.data(), i);
      MapVec3 acceleration = at(of(Field::acceleration), port.member[i]);
      if (way == Way::forward)
        acceleration += centripetalDerivative(w, change, r);
      else
        change += centripetalGradient(w, r, acceleration);
    }
  }
}

void Ports::gather(const double* f, const double* t, double* force, double* moment) const {
  for (std::size_t p = 0; p < driven_; ++p) {
    const Port& port = model_.ports[p];
    const Mat3 turned = rotation(p);
    Vec3 sum = Vec3::Zero(), turning = Vec3::Zero();
    for (std::size_t i = 0; i < port.member.size(); ++i) {
      const int node = port.member[i];
      const Vec3 load = at(f, node);
      sum += load;
      turning += (turned * at(port.arm.data(), i)).cross(load);
      if (node < model_.rotating()) turning += at(t, node);
    }
    at(force, p) += sum;
    at(moment, p) += turning;
  }
}

void Ports::spread(const double* v, const double* w, double* nodeV, double* nodeW) const {
  for (std::size_t p = 0; p < driven_; ++p) {
    const Port& port = model_.ports[p];
    const Mat3 turned = rotation(p);
    const Vec3 velocity = at(v, p), spin = at(w, p);
    for (std::size_t i = 0; i < port.member.size(); ++i) {
      const int node = port.member[i];
      at(nodeV, node) += velocity + spin.cross(turned * at(port.arm.data(), i));
      if (node < model_.rotating()) at(nodeW, node) += spin;
    }
  }
}

std::string Ports::findCollapsed() const {
  for (std::size_t k = 0; k < shapes_.size(); ++k)
    if (!std::isfinite(shapes_[k].inverse.sum())) return slavePort(k).name;
  return {};
}

void Ports::distributeLoads(const double* force, const double* moment, double* fs, double* ms) const {
  for (std::size_t k = 0; k < shapes_.size(); ++k) {
    const Port& port = slavePort(k);
    const Shape& s = shapes_[k];
    const Vec3 f = at(force, k), share = f / static_cast<double>(port.member.size());
    const Vec3 a = s.inverse * (Vec3(at(moment, k)) + s.lever.cross(f));
    for (std::size_t i = 0; i < port.member.size(); ++i) {
      const int slave = port.member[i];
      at(fs, slave) += share + a.cross(at(s.arm.data(), i));
      if (s.turning > 0 && slave < model_.turning()) at(ms, slave) += port.turnWeight * a;
    }
  }
}

Ports::Twist Ports::meanMotion(std::size_t k, const double* vs, const double* ws) const {
  const Port& port = slavePort(k);
  const Shape& s = shapes_[k];
  Vec3 v = Vec3::Zero(), turn = Vec3::Zero();
  for (std::size_t i = 0; i < port.member.size(); ++i) {
    const int slave = port.member[i];
    v += at(vs, slave);
    turn += at(s.arm.data(), i).cross(at(vs, slave));
    if (s.turning > 0 && slave < model_.turning()) turn += port.turnWeight * at(ws, slave);
  }
  const Vec3 w = s.inverse * turn;
  return {v / static_cast<double>(port.member.size()) + w.cross(s.lever), w};
}

void Ports::mapMotion(const double* vs, const double* ws, double* velocity, double* spin) const {
  for (std::size_t k = 0; k < shapes_.size(); ++k) {
    const Twist twist = meanMotion(k, vs, ws);
    at(velocity, k) = twist.velocity;
    at(spin, k) = twist.spin;
  }
}

double Ports::power(const double* vs, const double* ws) const {
  double sum = 0;
  for (std::size_t k = 0; k < shapes_.size(); ++k) {
    const Twist twist = meanMotion(k, vs, ws);
    sum += at(field(Field::portForce), k).dot(twist.velocity) + at(field(Field::portMoment), k).dot(twist.spin);
  }
  return sum;
}

void Ports::places(const double* xs, double* x) const {
  for (std::size_t p = 0; p < driven_; ++p) at(x, p) = at(field(Field::portPlace), p);
  for (std::size_t k = 0; k < shapes_.size(); ++k) {
    const Port& port = slavePort(k);
    Vec3 centre = Vec3::Zero();
    for (int slave : port.member) centre += at(xs, slave);
    at(x, driven_ + k) = centre / static_cast<double>(port.member.size()) + shapes_[k].lever;
  }
}

}  // namespace tiefmu
