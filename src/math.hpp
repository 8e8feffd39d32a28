// Small vectors, and the rotation of one step.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "elementary.hpp"

namespace tiefmu {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;
using MapVec3 = Eigen::Map<Vec3>;
using ConstMapVec3 = Eigen::Map<const Vec3>;

// How a derivative runs: a linear map forward, y += A x, or its transpose, x += A^T y.
enum class Way { forward, transposed };

inline MapVec3 at(double* p, Eigen::Index i) { return MapVec3(p + 3 * i); }
inline ConstMapVec3 at(const double* p, Eigen::Index i) { return ConstMapVec3(p + 3 * i); }

// (r.r) 1 - r r^T: inertia about the origin of a unit mass at r, m2. Sums over a segment's arms are Ibar, theory (1.2).
inline Mat3 unitInertia(const Vec3& r) { return r.squaredNorm() * Mat3::Identity() - r * r.transpose(); }

// The matrix of u x (.), so that skew(u) v = u x v.
inline Mat3 skew(const Vec3& u) {
  Mat3 m;
  m << 0, -u.z(), u.y(), u.z(), 0, -u.x(), -u.y(), u.x(), 0;
  return m;
}

// Change of w x (w x d) along dw, and the gradient of its product with `load` along dw.
inline Vec3 centripetalDerivative(const Vec3& w, const Vec3& dw, const Vec3& d) {
  return dw.cross(w.cross(d)) + w.cross(dw.cross(d));
}
inline Vec3 centripetalGradient(const Vec3& w, const Vec3& d, const Vec3& load) {
  return w.cross(d).cross(load) + d.cross(load.cross(w));
}

// Unit quaternion of the rotation vector `angle` (rad): the exponential map of SO(3), exact for any angle.
inline Quat exponential(const Vec3& angle) {
  const double half2 = 0.25 * angle.squaredNorm();
  double c, s;         // cos|angle/2| and sin|angle/2| / |angle/2|
  if (half2 < 1e-2) {  // Taylor: the next terms are below 1e-17
    c = 1 - half2 / 2 * (1 - half2 / 12 * (1 - half2 / 30 * (1 - half2 / 56 * (1 - half2 / 90))));
    s = 1 - half2 / 6 * (1 - half2 / 20 * (1 - half2 / 42 * (1 - half2 / 72 * (1 - half2 / 110))));
  } else {
    const double half = std::sqrt(half2);
    const SineCosine of = sineCosine(half);
    c = of.cosine;
    s = of.sine / half;
  }
  const Vec3 v = 0.5 * s * angle;
  return Quat(c, v.x(), v.y(), v.z());
}

// q (w, x, y, z) turned by the rotation vector `angle` (rad), its length held at 1 to rounding.
inline void turnQuaternion(double* q, const Vec3& angle) {
  const Quat next = exponential(angle) * Quat(q[0], q[1], q[2], q[3]);
  const double scale = 1.5 - 0.5 * next.squaredNorm();  // Newton step of 1/norm, which is 1 up to rounding
  q[0] = scale * next.w();
  q[1] = scale * next.x();
  q[2] = scale * next.y();
  q[3] = scale * next.z();
}

// Rate of the unit quaternion q (w, x, y, z) that turns at w (rad/s): (0, w) q / 2, 1/s.
inline void quaternionRate(const double* q, const Vec3& w, double* rate) {
  const Quat r = Quat(0, 0.5 * w.x(), 0.5 * w.y(), 0.5 * w.z()) * Quat(q[0], q[1], q[2], q[3]);
  rate[0] = r.w();
  rate[1] = r.x();
  rate[2] = r.y();
  rate[3] = r.z();
}

// Rotation vector (rad, length in [0, pi]) of a unit quaternion: the inverse of `exponential`.
inline Vec3 logarithm(const Quat& q) {
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const Vec3 v = sign * q.vec();
  const double n = v.norm();
  return n < 1e-12 ? Vec3(2.0 * v) : Vec3(2.0 * angleOf(n, sign * q.w()) / n * v);
}

}  // namespace tiefmu
