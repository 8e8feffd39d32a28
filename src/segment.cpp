#include "segment.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>

namespace tiefmu {
namespace {

constexpr double cornerXi[4] = {-1, 1, 1, -1};
constexpr double cornerEta[4] = {-1, -1, 1, 1};

// P(xi, eta) = c0 + c1 xi + c2 eta + c3 xi eta
struct Bilinear {
  Vec3 c0, c1, c2, c3;
  explicit Bilinear(const Vec3* x)
      : c0(0.25 * (x[0] + x[1] + x[2] + x[3])),
        c1(0.25 * (-x[0] + x[1] + x[2] - x[3])),
        c2(0.25 * (-x[0] - x[1] + x[2] + x[3])),
        c3(0.25 * (x[0] - x[1] + x[2] - x[3])) {}
  Vec3 operator()(double xi, double eta) const { return c0 + xi * c1 + eta * c2 + xi * eta * c3; }
};

// Newton on half the squared distance. Where the true Hessian is not positive definite (far from a warped quad) the
// Gauss-Newton one takes its place; halving keeps every step a descent.
bool newton(const Bilinear& surface, const Vec3& slave, double& xi, double& eta) {
  xi = eta = 0;
  double value = 0.5 * (slave - surface(xi, eta)).squaredNorm();
  for (int iteration = 0; iteration < 100; ++iteration) {
    const Vec3 gap = slave - surface(xi, eta);
    const Vec3 gXi = surface.c1 + eta * surface.c3, gEta = surface.c2 + xi * surface.c3;
    const double r0 = gap.dot(gXi), r1 = gap.dot(gEta);
    const double h00 = gXi.squaredNorm(), h11 = gEta.squaredNorm(), cross = gXi.dot(gEta);
    double h01 = cross - gap.dot(surface.c3);
    double det = h00 * h11 - h01 * h01;
    if (!(det > 1e-10 * h00 * h11)) {
      h01 = cross;
      det = h00 * h11 - h01 * h01;
      if (!(det > 1e-14 * h00 * h11)) {  // a point where the map folds: move along the diagonal only
        h01 = 0;
        det = h00 * h11;
        if (!(det > 0)) return false;
      }
    }
    double dXi = (h11 * r0 - h01 * r1) / det, dEta = (h00 * r1 - h01 * r0) / det;
    const double size = std::max(std::abs(dXi), std::abs(dEta));
    if (size <= 4e-16 * (1 + std::max(std::abs(xi), std::abs(eta)))) return true;
    bool moved = false;
    for (int halving = 0; halving < 40; ++halving, dXi *= 0.5, dEta *= 0.5) {
      const double next = 0.5 * (slave - surface(xi + dXi, eta + dEta)).squaredNorm();
      // Near the minimum the value is flat to rounding while the step still improves the point.
      if (next <= value || (halving == 0 && size < 1e-6 && next <= value * (1 + 1e-12))) {
        xi += dXi;
        eta += dEta;
        value = next;
        moved = true;
        break;
      }
    }
    if (!moved) return size < 1e-12;
    if (size < 1e-13 * (1 + std::max(std::abs(xi), std::abs(eta)))) return true;
  }
  return false;
}

}  // namespace

Phi shape(int n, double xi, double eta) {
  if (n == 3) return {1 - xi - eta, xi, eta, 0};
  Phi phi;
  for (int i = 0; i < 4; ++i) phi[i] = 0.25 * (1 + cornerXi[i] * xi) * (1 + cornerEta[i] * eta);
  return phi;
}

Projection project(int n, const Vec3* corner, const Vec3& slave) {
  Projection p;
  if (n == 4) {
    p.converged = newton(Bilinear(corner), slave, p.xi, p.eta);
  } else {
    const Vec3 u = corner[1] - corner[0], v = corner[2] - corner[0], s = slave - corner[0];
    const Vec3 normal = u.cross(v);
    const double area2 = normal.squaredNorm();
    p.converged = area2 > 0;
    if (p.converged) {
      p.xi = s.cross(v).dot(normal) / area2;
      p.eta = u.cross(s).dot(normal) / area2;
    }
  }
  p.phi = shape(n, p.xi, p.eta);
  for (int i = 0; i < n; ++i) p.point += p.phi[i] * corner[i];
  p.distance = (slave - p.point).norm();
  p.outside = n == 4 ? std::max(std::abs(p.xi), std::abs(p.eta)) : 1 - 2 * std::min({p.phi[0], p.phi[1], p.phi[2]});
  return p;
}

Phi clamped(int n, const double* p) {
  Phi phi{};
  std::copy_n(p, n, phi.begin());
  if (n == 4) {
    const double xi = p[1] + p[2] - p[0] - p[3], eta = p[2] + p[3] - p[0] - p[1];
    if (std::abs(xi) <= 1 && std::abs(eta) <= 1) {
      for (double& w : phi) w = std::max(w, 0.0);  // rounding on an edge
      return phi;
    }
    return shape(4, std::clamp(xi, -1.0, 1.0), std::clamp(eta, -1.0, 1.0));
  }
  double sum = 0;
  for (double& w : phi) sum += (w = std::max(w, 0.0));
  for (double& w : phi) w /= sum;
  return phi;
}

bool zeroArea(int n, const Vec3* x) {
  double longest2 = 0;
  for (int i = 0; i < n; ++i) longest2 = std::max(longest2, (x[(i + 1) % n] - x[i]).squaredNorm());
  const Vec3 area = n == 4 ? (x[2] - x[0]).cross(x[3] - x[1]) : (x[1] - x[0]).cross(x[2] - x[0]);
  return !(area.norm() > 1e-12 * longest2);
}

NodeInertia nodeInertia(int n, const Vec3* corner) {
  NodeInertia result;
  result.centre.setZero();
  for (int i = 0; i < n; ++i) result.centre += corner[i];
  result.centre /= n;
  result.ibar.setZero();
  for (int i = 0; i < n; ++i) {
    const Vec3 r = corner[i] - result.centre;
    result.ibar += r.squaredNorm() * Mat3::Identity() - r * r.transpose();
  }
  const Vec3 eigenvalues = Eigen::SelfAdjointEigenSolver<Mat3>(result.ibar, Eigen::EigenvaluesOnly).eigenvalues();
  const double smallest = eigenvalues(0), largest = eigenvalues(2);
  const double infinity = std::numeric_limits<double>::infinity();
  result.lambda = smallest > 0 ? 1 / smallest : infinity;
  result.condition = smallest > 0 ? largest / smallest : infinity;
  return result;
}

}  // namespace tiefmu
