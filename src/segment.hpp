// One master segment: shape functions, the projection of a point, and the inertia of its nodes (theory 7 and 1).
// `n` is 4 (bilinear quad, xi and eta in [-1, 1]) or 3 (plane triangle, Phi = (1 - xi - eta, xi, eta)).
#pragma once

#include <array>
#include <limits>

#include "math.hpp"

namespace tiefmu {

using Phi = std::array<double, 4>;  // a triangle's fourth entry is 0

Phi shape(int n, double xi, double eta);

struct Projection {
  static constexpr double farthest = 1.5;  // `outside` up to which a projection is looked for

  // The closest point of the extended surface within `farthest` is known. For a slave whose closest point of the
  // segment lies inside it, that point; else the closest one beyond the edges that is no farther than the segment.
  bool converged = false;
  bool folded = false;  // beside an inward corner (chevron), where the surface lies over itself: no answer is right
  double xi = 0, eta = 0;
  Phi phi{};
  Vec3 offset = Vec3::Zero();  // S - P with P = sum Phi_i x_i, m; from coordinate differences
  double distance = 0;         // |offset|, m
  // How far outside: <= 1 inside; max(|xi|, |eta|) for a quad, max(1 - 2 Phi_i) for a triangle, which is 1 on an edge
  // and grows by 1 per half height beyond it, as for a quad. Infinite where none is known.
  double outside = std::numeric_limits<double>::infinity();
  // To the closest point of the segment itself, edges and corners included, m.
  Vec3 toNearest = Vec3::Zero();
  double nearest = std::numeric_limits<double>::infinity();
};

// Projection of the point `slave` (theory 7), exact to the rounding of coordinate differences: the same wherever the
// segment stands. A segment that is certainly farther than `within` (m) may be left at nearest = infinity.
Projection project(int n, const Vec3* corner, const Vec3& slave,
                   double within = std::numeric_limits<double>::infinity());

// Phi of a projection (n entries) clamped to the segment: a quad's xi and eta to [-1, 1]; a triangle's negative Phi to
// 0, the rest scaled to the sum 1, which treats its three nodes alike.
Phi clamped(int n, const double* phi);

// No area (coincident or collinear nodes): the cross product of the diagonals (edges) below 1e-12 of the longest edge
// squared, or below what the rounding of the coordinates leaves of it.
bool zeroArea(int n, const Vec3* corner);

// A quad two of whose opposite edges cross, or pass each other closer than a tenth of the shorter one of the others:
// its nodes are not in order round it.
bool crossesItself(int n, const Vec3* corner);

// What rounding to doubles may have moved these points by, m.
double coordinateNoise(int n, const Vec3* corner);

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
