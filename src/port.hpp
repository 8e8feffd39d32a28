// Rigid ports: many nodes as one body of six degrees of freedom about a reference point, theory (3.9) to (3.14).
//
// A port of driven nodes moves them, v_i = v + w x r_i with arms r_i = R r_i0, R advanced by the exponential map, and
// sums what ties and springs do to them: f = sum f_i, t = sum t_i + r_i x f_i.
// A port of slaves follows their mean rigid motion (theory 2, optimized, with N slaves in place of n masters) and
// spreads its load by the transpose (theory 3):
//   v = (1/N) sum v_s + w x e        w = J^-1 (sum r_s x v_s + L2 sum w_s)
//   f_s = f/N + A x r_s              m_s = L2 A        A = J^-1 (t + e x f)
//   J = sum ((r_s.r_s) 1 - r_s r_s^T + L2 1)
// with r_s from the slaves' mean and e from there to the reference point. L2 is zero except for slaves on a line,
// whose places leave the rotation about it open: then the own rotations of those that can turn decide it, and only they
// are in the sums with L2. So f.v + t.w = sum f_s.v_s + m_s.w_s, and force and moment are exact.
#pragma once

#include <string>
#include <vector>

#include "input_curve.hpp"
#include "layout.hpp"

namespace tiefmu {

// J of slaves at these arms (3 per member), as it is without their own rotations.
Mat3 armInertia(const std::vector<double>& arm);

class Ports {
 public:
  // Works on the array `data` laid out by `layout`.
  Ports(const Model& model, const Layout& layout, double* data);

  bool anyDriven() const { return driven_ > 0; }
  bool anyOfSlaves() const { return model_.ports.size() > driven_; }
  bool moves(int node) const { return !moved_.empty() && moved_[node]; }

  void setStart();

  // --- driven nodes
  void move();  // velocities and accelerations of the nodes, from the ports' inputs
  // Before a drift over [tau, tau + h] of the inputs' curve: the velocities and spins that carry the nodes to its end.
  void carry(const InputCurve& inputs, double tau, double h);
  void advance(const InputCurve& inputs, double tau, double h);  // after it: pose, positions and velocities at the end
  // How `move` changes, in an array laid out like `data`: adds to the nodes' motion, or transposed to the inputs.
  void differentiateMotion(Way way, double* array) const;
  // Resultants of the nodes' loads (f 3 per node, N; t 3 per rotating node, N m), added to force, moment (3 per port).
  void gather(const double* f, const double* t, double* force, double* moment) const;
  // The transpose: a rigid motion of each port, added to that of its nodes.
  void spread(const double* v, const double* w, double* nodeV, double* nodeW) const;

  // --- slaves
  // Arms and J at slave positions `xs` (m; small displacements: as they were at the start). `quaternion(k)`: the
  // rotation number k as SpringEnd::orientation counts.
  template <class Quaternion> void shape(const double* xs, Quaternion quaternion);
  std::string findCollapsed() const;  // name of a port whose slaves have come to lie on a line; empty: none
  void distributeLoads(const double* force, const double* moment, double* fs,
                       double* ms) const;  // added to the slaves' loads
  void mapMotion(const double* vs, const double* ws, double* velocity, double* spin) const;
  double power(const double* vs, const double* ws) const;  // of the loads that are inputs, W
  // Of the reference points, 3 per port: those of driven nodes, then those of slaves at positions `xs`.
  void places(const double* xs, double* x) const;

 private:
  struct Shape {
    std::vector<double> arm;
    Mat3 inverse = Mat3::Zero();
    Vec3 lever = Vec3::Zero();
    int turning = 0;  // slaves whose rotation weighs
  };
  struct Motion { Vec3 shift, turn; };    // over a drift: translation (m), rotation vector (rad)
  struct Twist { Vec3 velocity, spin; };  // m/s, rad/s
  const Port& slavePort(std::size_t k) const { return model_.ports[driven_ + k]; }
  Motion motion(const InputCurve& inputs, std::size_t port, double tau, double h) const;
  Mat3 rotation(std::size_t port) const;
  void moveNodes(std::size_t port, bool places);
  double* field(Field f) const { return data_ + layout_[f].offset; }
  void setShape(std::size_t k, const Mat3* turned);
  Twist meanMotion(std::size_t k, const double* vs, const double* ws) const;

  const Model& model_;
  const Layout& layout_;
  double* data_;
  std::size_t driven_ = 0;
  std::vector<std::uint8_t> moved_;  // per node: belongs to a port
  std::vector<Shape> shapes_;        // per port of slaves
};

template <class Quaternion> void Ports::shape(const double* xs, Quaternion quaternion) {
  if (!model_.finite()) return;
  for (std::size_t k = 0; k < shapes_.size(); ++k) {
    const Port& port = slavePort(k);
    Shape& s = shapes_[k];
    const std::size_t n = port.member.size();
    if (n > 1) {
      Vec3 centre = Vec3::Zero();
      for (int slave : port.member) centre += at(xs, slave);
      centre /= static_cast<double>(n);
      for (std::size_t i = 0; i < n; ++i) at(s.arm.data(), i) = at(xs, port.member[i]) - centre;
    }
    Mat3 turned = Mat3::Zero();  // L2 times the sum of the slaves' rotations
    for (int index : port.orientation)
      if (index >= 0) {
        const double* q = quaternion(index);
        turned += port.turnWeight * Quat(q[0], q[1], q[2], q[3]).toRotationMatrix();
      }
    setShape(k, &turned);
  }
}

}  // namespace tiefmu
