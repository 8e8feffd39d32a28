#include "stability.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>

#include "integrator.hpp"

namespace tiefmu {
namespace {

constexpr int maxVectors = 32, maxRestarts = 40;
constexpr double tolerance = 1e-9;
// Many unknowns: digits beyond these cost more than the time step gains; the bound takes up the difference.
constexpr int manyUnknowns = 3000;
constexpr double looseTolerance = 1e-4;
constexpr double none = 1e30;

// A step is stable if no root of its characteristic polynomial is larger than this.
constexpr double largestRoot = 1 + 1e-10;

// One step of size h on x'' = -omega^2 x - c x'.
bool nohBatheStable(double h, double omega, double c) {
  constexpr double p = nohBathe::p, q0 = nohBathe::q0, q1 = nohBathe::q1, q2 = nohBathe::q2;
  Mat3 step;
  for (int column = 0; column < 3; ++column) {
    Vec3 unit = Vec3::Unit(column);
    double x = unit(0), v = unit(1), a = unit(2);
    const auto force = [&](double position, double velocity) { return -omega * omega * position - c * velocity; };
    const double h1 = p * h, h2 = (1 - p) * h;
    x += h1 * v + 0.5 * h1 * h1 * a;
    const double a1 = force(x, v + h1 * a);
    v += 0.5 * h1 * (a + a1);
    x += h2 * v + 0.5 * h2 * h2 * a1;
    const double a2 = force(x, v + h2 * a1);
    v += h2 * (q0 * a + (0.5 + q1) * a1 + q2 * a2);
    step.col(column) = Vec3(x, v, a2);
  }
  // lambda^3 + a lambda^2 + b lambda + d for roots in units of the largest one allowed; all are inside the unit circle
  // if the conditions of [Jury 1964] hold.
  const Mat3 m = step / largestRoot;
  const double a = -m.trace(), d = -m.determinant();
  const double b = m(0, 0) * m(1, 1) - m(0, 1) * m(1, 0) + m(0, 0) * m(2, 2) - m(0, 2) * m(2, 0) + m(1, 1) * m(2, 2) -
                   m(1, 2) * m(2, 1);
  return 1 + a + b + d > 0 && 1 - a + b - d > 0 && std::abs(d) < 1 && 1 - d * d > std::abs(a * d - b);
}

// |R(h lambda)| for both roots of lambda^2 + c lambda + omega^2 = 0, R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24.
bool rk4Stable(double h, double omega, double c) {
  const double discriminant = c * c - 4 * omega * omega, root = std::sqrt(std::abs(discriminant));
  for (const double sign : {1.0, -1.0}) {
    const double x = 0.5 * h * (discriminant < 0 ? -c : -c + sign * root), y = discriminant < 0 ? 0.5 * h * root : 0;
    double re = 1, im = 0;
    for (const double k : {4.0, 3.0, 2.0, 1.0}) {  // Horner: 1 + z/k (...)
      const double next = 1 + (x * re - y * im) / k;
      im = (x * im + y * re) / k;
      re = next;
    }
    if (!(re * re + im * im <= largestRoot * largestRoot)) return false;
  }
  return true;
}

}  // namespace

double stableStep(Method method, double omega, double c) {
  if (!(omega > 0) && !(c > 0)) return none;
  bool (*isStable)(double, double, double) = nullptr;
  switch (method) {
    case Method::centralDifference:
    case Method::symplecticEuler:
      return 4 / (c + std::sqrt(c * c + 4 * omega * omega));  // = 2/omega (sqrt(1 + z^2) - z), also for omega = 0
    case Method::nohBathe: isStable = nohBatheStable; break;
    case Method::rk4: isStable = rk4Stable; break;
  }
  // Without units: in s and m/s^2 the entries of a step's matrix are many decades apart, and its eigenvalues are lost.
  const double scale = 1 / std::max(omega, c);
  omega *= scale;
  c *= scale;
  const auto stable = [&](double h) { return isStable(h, omega, c); };
  double low = 0, high = 8;
  for (double h = 0.02; h < high; h += 0.02) {
    if (!stable(h)) {
      high = h;
      break;
    }
    low = h;
  }
  for (int i = 0; i < 60; ++i) (stable(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
  return low * scale;
}

double damperPrediction(double h, double omega, double c) {
  if (!(c > 0)) return 1;
  return std::clamp((4 - omega * omega * h * h) / (2 * c * h) - 1, 0.0, 1.0);
}

double nodalStep(double inertia, double stiffness) { return stiffness > 0 ? std::sqrt(2 * inertia / stiffness) : none; }

double nodalStep(const Model& model, const double* addedMass, const double* addedInertia, const double* stiffness,
                 const double* rotationalStiffness) {
  double smallest = none;
  for (int group : {rotatingFreeMaster, freeMaster})
    for (int i = model.begin[group]; i < model.begin[group + 1]; ++i) {
      smallest = std::min(smallest, nodalStep(model.nodeMass[i] + addedMass[i], stiffness[i]));
      if (i < model.rotating())
        smallest = std::min(smallest, nodalStep(model.nodeInertia[i] + addedInertia[i], rotationalStiffness[i]));
    }
  return smallest;
}

Spectrum::Spectrum(Dynamics& dynamics)
    : dynamics_(dynamics), size_(3 * (dynamics.model.free() + dynamics.model.rotating() - dynamics.model.freeBegin())) {
  const Model& model = dynamics.model;
  if (model.springs.empty()) return;
  u_.resize(3 * static_cast<std::size_t>(model.nodes()));
  f_.resize(u_.size());
  turn_.resize(3 * static_cast<std::size_t>(model.rotating()));
  t_.resize(turn_.size());
  // Room for `refresh`, which may come first: after a state from another process.
  basis_.resize(static_cast<std::size_t>(size_) * (refreshVectors + 1));
  image_.resize(basis_.size());
}

// Compact vectors hold the free translations, then the free rotations.
void Spectrum::apply(const double* x, double* y, bool damping) {
  const Model& model = dynamics_.model;
  const int first = 3 * model.freeBegin(), free = 3 * model.free(), turning = size_ - free;
  std::fill(u_.begin(), u_.end(), 0.0);
  std::fill(turn_.begin(), turn_.end(), 0.0);
  std::copy_n(x, free, u_.begin() + first);
  std::copy_n(x + free, turning, turn_.begin() + first);
  dynamics_.springs.applyTangent(u_.data(), turn_.data(), f_.data(), t_.data(), damping);
  std::copy_n(f_.begin() + first, free, y);
  std::copy_n(t_.begin() + first, turning, y + free);
}

// x = M^-1 p; x holds a guess on entry.
void Spectrum::solve(const double* p, double* x) {
  const Model& model = dynamics_.model;
  const int first = 3 * model.freeBegin(), free = 3 * model.free(), turning = size_ - free;
  std::copy_n(p, free, f_.begin() + first);
  std::copy_n(p + free, turning, t_.begin() + first);
  std::copy_n(x, free, u_.begin() + first);
  std::copy_n(x + free, turning, turn_.begin() + first);
  dynamics_.solveInertia(f_.data(), t_.data(), u_.data(), turn_.data());
  std::copy_n(u_.begin() + first, free, x);
  std::copy_n(turn_.begin() + first, turning, x + free);
}

Spectrum::Value Spectrum::lanczos(bool damping, double* mode, int vectors) {
  using Vector = Eigen::Map<Eigen::VectorXd>;
  using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, maxVectors, maxVectors>;
  const auto v = [&](int j) { return Vector(basis_.data() + static_cast<std::ptrdiff_t>(size_) * j, size_); };
  const auto mv = [&](int j) { return Vector(image_.data() + static_cast<std::ptrdiff_t>(size_) * j, size_); };
  using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, maxVectors, 1>;
  SmallVector diagonal = SmallVector::Zero(vectors), subdiagonal = SmallVector::Zero(vectors);
  mv(0) = Vector(mode, size_);
  v(0).setZero();
  solve(mv(0).data(), v(0).data());
  double norm = std::sqrt(std::max(0.0, v(0).dot(mv(0))));
  if (!(norm > 0)) return {};
  v(0) /= norm;
  mv(0) /= norm;
  int used = 0;
  double beta = 0;
  while (used < vectors) {
    const int j = used++;
    auto p = mv(j + 1), x = v(j + 1);
    apply(v(j).data(), p.data(), damping);
    x.setZero();
    solve(p.data(), x.data());
    diagonal(j) = v(j).dot(p);
    // Full reorthogonalisation; in the second sweep on an x made anew of p, as cancellation has parted the two.
    for (int sweep = 0; sweep < 2; ++sweep) {
      for (int i = 0; i <= j; ++i) {
        const double c = v(i).dot(p);
        x -= c * v(i);
        p -= c * mv(i);
      }
      solve(p.data(), x.data());
    }
    beta = std::sqrt(std::max(0.0, x.dot(p)));
    const double scale = diagonal.head(used).cwiseAbs().maxCoeff();
    if (!(beta > tolerance * scale)) break;  // the space is exhausted: what is left is rounding
    if (used < vectors) subdiagonal(j) = beta;
    x /= beta;
    p /= beta;
  }
  Eigen::SelfAdjointEigenSolver<Small> eigen;  // which takes what is small beside 1 for nothing
  const double unit = std::max(diagonal.head(used).cwiseAbs().maxCoeff(), std::numeric_limits<double>::min());
  eigen.computeFromTridiagonal(diagonal.head(used) / unit, subdiagonal.head(used - 1) / unit);
  const auto y = eigen.eigenvectors().col(used - 1);
  Vector ritz(mode, size_);
  ritz.setZero();
  for (int j = 0; j < used; ++j) ritz += y(j) * mv(j);
  return {unit * eigen.eigenvalues()(used - 1), beta * std::abs(y(used - 1))};
}

Spectrum::Value Spectrum::largest(bool damping, double* mode) {
  std::vector<double> own;
  if (!mode) {
    own.resize(size_);
    mode = own.data();
  }
  // A start that no symmetry is orthogonal to, the same on every machine.
  std::uint64_t seed = 0x9E3779B97F4A7C15u;
  for (int k = 0; k < size_; ++k) {
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    mode[k] = static_cast<double>(seed >> 11) * 0x1p-53 - 0.5;
  }
  const int vectors = std::min(maxVectors, size_);
  basis_.resize(static_cast<std::size_t>(size_) * (vectors + 1));
  image_.resize(basis_.size());
  Value value;
  for (int restart = 0; restart < maxRestarts; ++restart) {
    value = lanczos(damping, mode, vectors);
    if (value.residual <= (size_ > manyUnknowns ? looseTolerance : tolerance) * value.ritz) break;
  }
  basis_.resize(static_cast<std::size_t>(size_) * (refreshVectors + 1));
  image_.resize(basis_.size());
  basis_.shrink_to_fit();
  image_.shrink_to_fit();
  return value;
}

Spectrum::Value Spectrum::refresh(double* mode) { return lanczos(false, mode, std::min(refreshVectors, size_)); }

}  // namespace tiefmu
