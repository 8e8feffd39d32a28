#include "segment.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>

namespace tiefmu {
namespace {

constexpr double cornerXi[4] = {-1, 1, 1, -1};
constexpr double cornerEta[4] = {-1, -1, 1, 1};

}  // namespace

Phi shape(int n, double xi, double eta) {
  if (n == 3) return {1 - xi - eta, xi, eta, 0};
  Phi phi;
  for (int i = 0; i < 4; ++i) phi[i] = 0.25 * (1 + cornerXi[i] * xi) * (1 + cornerEta[i] * eta);
  return phi;
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

double coordinateNoise(int n, const Vec3* x) {
  double most = 0;
  for (int i = 0; i < n; ++i) most = std::max(most, x[i].cwiseAbs().maxCoeff());
  return 4 * std::numeric_limits<double>::epsilon() * most;
}

bool zeroArea(int n, const Vec3* x) {
  double longest2 = 0;
  for (int i = 0; i < n; ++i) longest2 = std::max(longest2, (x[(i + 1) % n] - x[i]).squaredNorm());
  const Vec3 area = n == 4 ? (x[2] - x[0]).cross(x[3] - x[1]) : (x[1] - x[0]).cross(x[2] - x[0]);
  return !(area.norm() > std::max(1e-12 * longest2, coordinateNoise(n, x) * std::sqrt(longest2)));
}

bool crossesItself(int n, const Vec3* x) {
  if (n != 4) return false;
  for (int i = 0; i < 2; ++i) {
    const Vec3 a = x[i], u = x[i + 1] - a, b = x[i + 2], v = x[(i + 3) % 4] - b, w = b - a;
    const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v), det = uu * vv - uv * uv;
    if (!(det > 1e-12 * uu * vv)) continue;  // parallel
    const double s = (w.dot(u) * vv - w.dot(v) * uv) / det, t = (w.dot(u) * uv - w.dot(v) * uu) / det;
    const double inner = 1e-9;  // an edge that only touches the other's end does not cross it
    if (s < inner || s > 1 - inner || t < inner || t > 1 - inner) continue;
    const double others = std::min((x[i + 2] - x[i + 1]).norm(), (x[i] - x[(i + 3) % 4]).norm());
    if ((w + t * v - s * u).norm() < 0.1 * others) return true;
  }
  return false;
}

NodeInertia nodeInertia(int n, const Vec3* corner) {
  NodeInertia result;
  result.centre.setZero();
  for (int i = 0; i < n; ++i) result.centre += corner[i];
  result.centre /= n;
  result.ibar.setZero();
  for (int i = 0; i < n; ++i) {
    const Vec3 r = corner[i] - result.centre;
    result.ibar += unitInertia(r);
  }
  const Vec3 eigenvalues = Eigen::SelfAdjointEigenSolver<Mat3>(result.ibar, Eigen::EigenvaluesOnly).eigenvalues();
  const double smallest = eigenvalues(0), largest = eigenvalues(2);
  const double infinity = std::numeric_limits<double>::infinity();
  result.lambda = smallest > 0 ? 1 / smallest : infinity;
  result.condition = smallest > 0 ? largest / smallest : infinity;
  return result;
}

}  // namespace tiefmu
