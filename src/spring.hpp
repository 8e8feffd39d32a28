// Axial springs and bushings between two ends.
#pragma once

#include "model.hpp"

namespace tiefmu {

// Motion of one end: position m, velocity m/s, angular velocity rad/s, rotation since the start (unit quaternion).
struct EndMotion {
  Vec3 x = Vec3::Zero(), v = Vec3::Zero(), w = Vec3::Zero();
  Quat q = Quat::Identity();
};

// What the spring does to its ends: forces N, moments N m on a and b; stored energy J; dissipated power W.
struct SpringLoad {
  Vec3 fa = Vec3::Zero(), fb = Vec3::Zero(), ta = Vec3::Zero(), tb = Vec3::Zero();
  double energy = 0, dissipation = 0;
};

// Axial, theory (3.5): stiffness times the elongation along the current line, damping times its rate.
// Bushing, theory (3.6) to (3.8): translation u = x_a - x_b - R_b arm, rotation vector theta of R_b R_a^T, both in
// inertial axes; the moment of the force on a about b is balanced on b. With isotropic stiffness the forces derive from
// (k u.u + kr theta.theta) / 2.
// Beam, theory (3.15) to (3.18): both measured from the rotation half-way between the ends', along axes that turn with
// it, so that any stiffness has a potential and a beam of straight, equal sections is exact to first order.
SpringLoad springLoad(const Spring& spring, const EndMotion& a, const EndMotion& b);

// The linear part about the present state, of the material and of an axial spring's tension across its line: from a
// displacement and a small rotation of the ends, given as their `v` and `w`, to restoring loads. With `damping` the
// damping coefficients in place of the stiffness. Symmetric and positive semidefinite.
SpringLoad springTangent(const Spring& spring, const EndMotion& a, const EndMotion& b, bool damping);

// How springLoad changes with its ends' x, v and w (their rotations stay), exact to first order, in blocks of 3 x 3:
// fb, ta and tb (fa = -fb) by x_a - x_b, v_a - v_b, w_a and w_b; and the stored energy by x_a - x_b.
struct SpringJacobian {
  Eigen::Matrix<double, 9, 12> loads = Eigen::Matrix<double, 9, 12>::Zero();
  Vec3 energy = Vec3::Zero();
};
SpringJacobian springJacobian(const Spring& spring, const EndMotion& a, const EndMotion& b);

}  // namespace tiefmu
