// One master segment: shape functions, the projection of a point, and the inertia of its nodes (theory 7 and 1).
// `n` is 4 (bilinear quad, xi and eta in [-1, 1]) or 3 (plane triangle, Phi = (1 - xi - eta, xi, eta)).
#pragma once

#include <array>

#include "math.hpp"

namespace tiefmu {

using Phi = std::array<double, 4>;  // a triangle's fourth entry is 0

Phi shape(int n, double xi, double eta);

struct Projection {
  bool converged = false;
  double xi = 0, eta = 0;
  Phi phi{};
  Vec3 point = Vec3::Zero();  // P = sum Phi_i x_i, m
  double distance = 0;        // |S - P|, m
  // How far outside: <= 1 inside; max(|xi|, |eta|) for a quad, max(1 - 2 Phi_i) for a triangle, which is 1 on an edge
  // and grows by 1 per half height beyond it, as for a quad.
  double outside = 0;
};

// Closest point of the segment's surface, extended beyond its edges, by Newton from the centre; exact to 1e-12 of the
// segment's size. `converged` is false where Newton does not settle.
Projection project(int n, const Vec3* corner, const Vec3& slave);

// Phi of a projection (n entries) clamped to the segment: a quad's xi and eta to [-1, 1]; a triangle's negative Phi to
// 0, the rest scaled to the sum 1, which treats its three nodes alike.
Phi clamped(int n, const double* phi);

// No area (coincident or collinear nodes, or a quad folded onto itself): the cross product of the diagonals (edges)
// below 1e-12 of the longest edge squared.
bool zeroArea(int n, const Vec3* corner);

struct NodeInertia {
  Vec3 centre;        // C, m
  Mat3 ibar;          // sum (r.r) 1 - r r^T, m2
  double lambda = 0;  // 1 / smallest eigenvalue, 1/m2 (infinite for collinear nodes)
  double condition = 0;
};
NodeInertia nodeInertia(int n, const Vec3* corner);

// Inverse of a symmetric positive definite 3x3 matrix by cofactors.
inline Mat3 inverseSymmetric(const Mat3& m) {
  const double a = m(0, 0), b = m(0, 1), c = m(0, 2), d = m(1, 1), e = m(1, 2), f = m(2, 2);
  const double A = d * f - e * e, B = c * e - b * f, C = b * e - c * d;
  const double s = 1.0 / (a * A + b * B + c * C);
  Mat3 r;
  r << A, B, C, B, a * f - c * c, b * c - a * e, C, b * c - a * e, a * d - b * b;
  return s * r;
}

}  // namespace tiefmu
