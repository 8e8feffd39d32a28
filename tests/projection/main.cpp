// Projections of random points on random quads against a search in extended precision that shares nothing with it:
// a grid over the extended patch, and from each of its low points a damped Newton to rounding.
//
//   tiefmu_projection COUNT [SEED]     prints what disagrees and a line of counts; exit status 1 if anything does
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "segment.hpp"

namespace {

using tiefmu::Vec3;
using Real = long double;
using R3 = std::array<Real, 3>;

R3 operator+(const R3& a, const R3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
R3 operator-(const R3& a, const R3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
R3 operator*(Real f, const R3& a) { return {f * a[0], f * a[1], f * a[2]}; }
Real dot(const R3& a, const R3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Real norm(const R3& a) { return std::sqrt(dot(a, a)); }
constexpr Real farthest = 1.5L;

struct Point {
  Real xi, eta, distance;
  Real outside() const { return std::max(std::abs(xi), std::abs(eta)); }
};

struct Oracle {
  R3 x[4], s;
  std::vector<Point> minima;
  Real toEdges = 1e300L, size = 0;

  // `thorough`: from every point of the grid.
  Oracle(const Vec3* corner, const Vec3& slave, bool thorough) {
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k) x[i][k] = Real(corner[i][k]) - Real(corner[0][k]);
    for (int k = 0; k < 3; ++k) s[k] = Real(slave[k]) - Real(corner[0][k]);
    for (int i = 0; i < 4; ++i) {
      const R3 u = x[(i + 1) % 4] - x[i], r = s - x[i];
      const Real t = dot(u, u) > 0 ? std::clamp(dot(r, u) / dot(u, u), Real(0), Real(1)) : 0;
      toEdges = std::min(toEdges, norm(r - t * u));
      size = std::max(size, norm(u));
    }
    constexpr int n = 25;
    constexpr Real most = 1.6L;
    static Real value[n][n];
    const auto at = [](int i) { return most * (Real(2 * i) / (n - 1) - 1); };
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) value[i][j] = norm(gap(at(i), at(j)));
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        bool low = true;
        for (int a = std::max(i - 1, 0); a <= std::min(i + 1, n - 1) && !thorough; ++a)
          for (int b = std::max(j - 1, 0); b <= std::min(j + 1, n - 1); ++b) low &= value[i][j] <= value[a][b];
        if (low) descend(at(i), at(j));
      }
  }

  R3 map(Real xi, Real eta) const {
    return Real(0.25L) * ((1 - xi) * (1 - eta) * x[0] + (1 + xi) * (1 - eta) * x[1] + (1 + xi) * (1 + eta) * x[2] +
                          (1 - xi) * (1 + eta) * x[3]);
  }
  R3 gap(Real xi, Real eta) const { return s - map(xi, eta); }
  R3 alongXi(Real eta) const { return 0.25L * ((1 - eta) * (x[1] - x[0]) + (1 + eta) * (x[2] - x[3])); }
  R3 alongEta(Real xi) const { return 0.25L * ((1 - xi) * (x[3] - x[0]) + (1 + xi) * (x[2] - x[1])); }
  R3 mixed() const { return 0.25L * (x[0] - x[1] + x[2] - x[3]); }

  struct Hessian { Real a, b, c, f0, f1; };
  Hessian hessian(Real xi, Real eta) const {
    const R3 r = gap(xi, eta), A = alongXi(eta), B = alongEta(xi);
    return {dot(A, A), dot(A, B) - dot(r, mixed()), dot(B, B), dot(r, A), dot(r, B)};
  }

  // Levenberg-Marquardt on half the squared distance, then plain Newton.
  void descend(Real xi, Real eta) {
    Real damping = 1e-6L, value = norm(gap(xi, eta));
    for (int k = 0; k < 200; ++k) {
      const Hessian h = hessian(xi, eta);
      const Real a = h.a * (1 + damping), c = h.c * (1 + damping), det = a * c - h.b * h.b;
      Real dXi = 0, dEta = 0, next = 1e300L;
      if (det > 1e-12L * a * c) {
        dXi = (c * h.f0 - h.b * h.f1) / det, dEta = (a * h.f1 - h.b * h.f0) / det;
        next = norm(gap(xi + dXi, eta + dEta));
      }
      if (next <= value) {
        xi += dXi, eta += dEta, value = next, damping /= 10;
        if (std::abs(xi) > 10 || std::abs(eta) > 10) return;
        if (std::abs(dXi) + std::abs(dEta) < 1e-17L) break;
      } else if ((damping = std::max(10 * damping, Real(1e-6L))) > 1e12L)
        break;
    }
    for (int k = 0; k < 4; ++k) {
      const Hessian h = hessian(xi, eta);
      const Real det = h.a * h.c - h.b * h.b;
      if (!(det > 1e-14L * h.a * h.c)) break;
      const Real dXi = (h.c * h.f0 - h.b * h.f1) / det, dEta = (h.a * h.f1 - h.b * h.f0) / det;
      if (std::abs(dXi) + std::abs(dEta) > 1e-3L) return;
      xi += dXi, eta += dEta;
    }
    const Hessian h = hessian(xi, eta);
    if (!(h.a * h.c - h.b * h.b > 0)) return;
    const Real scale = (norm(s) + size);
    if (std::abs(h.f0) > 1e-12L * scale * std::sqrt(h.a) || std::abs(h.f1) > 1e-12L * scale * std::sqrt(h.c)) return;
    minima.push_back({xi, eta, norm(gap(xi, eta))});
  }

  // Closest point of the segment inside it, else the closest of the surface round it; ties: deepest inside.
  const Point* best(Real& nearest) const {
    const Point* inside = pick(1);
    nearest = inside ? std::min(toEdges, inside->distance) : toEdges;
    return inside && inside->distance <= toEdges ? inside : pick(farthest);
  }
  const Point* pick(Real limit) const {
    const Point* p = nullptr;
    const Real tie = 1e-10L * size;
    for (const Point& q : minima)
      if (q.outside() <= limit &&
          (!p || q.distance < p->distance - tie || (q.distance <= p->distance + tie && q.outside() < p->outside())))
        p = &q;
    return p;
  }
};

struct Verdict {
  // A point inside the segment that is nearer than all the search has found, by its own map: the search has missed it.
  bool missed = false;
  bool refused = false, wrong = false, none = false, doubtful = false;
  Real error = 0;  // of the point on the surface, in what rounding allows
  char line[400] = "";
};

Verdict judge(const Oracle& oracle, const tiefmu::Projection& p) {
  Verdict v;
  Real nearest;
  const Point* best = oracle.best(nearest);
  const Real noise = 16 * 2.3e-16L * (oracle.size + norm(oracle.s));  // what rounding leaves of differences
  if (p.converged && p.outside <= 1) {
    const Real own = norm(oracle.gap(p.xi, p.eta));
    v.missed = own < nearest - noise && std::abs(own - p.distance) <= noise && std::abs(own - p.nearest) <= noise;
    if (v.missed) return v;
  }
  v.wrong = std::abs(p.nearest - nearest) > noise;
  v.none = !best;
  // Two corners in one place: there the program may find what is outside by xi alone, the slave's distance is the same.
  const bool triangle = norm(oracle.x[3] - oracle.x[2]) == 0;
  if (!best) {
    v.wrong |= p.converged && p.outside <= 1.5 && !triangle;
  } else if (!p.converged || p.outside > 1.5 + 1e-6) {
    v.refused = best->outside() < 1.5L - 1e-6L;
  } else {
    v.wrong |= std::abs(p.distance - best->distance) > noise;
    for (const Point& q : oracle.minima)  // another one, as near
      v.doubtful |= &q != best && std::abs(q.distance - best->distance) < 1e-9L * oracle.size &&
                    std::abs(q.xi - best->xi) + std::abs(q.eta - best->eta) > 1e-6L;
    // the error of xi and eta that a change of the offset by `noise` brings about
    const Oracle::Hessian h = oracle.hessian(best->xi, best->eta);
    const Real det = h.a * h.c - h.b * h.b, fa = noise * std::sqrt(h.a), fb = noise * std::sqrt(h.c);
    const Real dXi = (h.c * fa + std::abs(h.b) * fb) / det, dEta = (h.a * fb + std::abs(h.b) * fa) / det;
    if (!v.doubtful && dXi < 1e-3L && dEta < 1e-3L) {
      v.error = std::max(std::abs(p.xi - best->xi) / dXi, std::abs(p.eta - best->eta) / dEta);
      v.wrong |= v.error > 1;
    }
  }
  std::snprintf(v.line, sizeof v.line,
                "size %.3Lg%s: xi %.9g, eta %.9g, outside %.9g, distance %.9g, nearest %.9g; "
                "expected xi %.9Lg, eta %.9Lg, distance %.9Lg, nearest %.9Lg",
                oracle.size, triangle ? ", triangle" : "", p.xi, p.eta, p.outside, p.distance, p.nearest,
                best ? best->xi : NAN, best ? best->eta : NAN, best ? best->distance : NAN, nearest);
  return v;
}

struct Counts {
  long tried = 0, missed = 0, crossing = 0, folded = 0, none = 0, doubtful = 0, refused = 0, wrong = 0;
  Real error = 0;
};

}  // namespace

int main(int argc, char** argv) {
  const long count = argc > 1 ? std::atol(argv[1]) : 20000;
  std::mt19937_64 random(argc > 2 ? std::atoll(argv[2]) : 1);
  const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  const auto one = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  Counts c;
  while (c.tried < count) {
    // a quad in its own plane, then turned, moved and rounded
    const double size = std::pow(10, uniform(-3, 1)), across = size / std::pow(20, uniform(0, 1));
    const double shake = uniform(0, 1) < 0.5 ? 0.2 : 0.6, warp = one(4) ? uniform(0, 0.3) : 0;
    const double plane[4][2] = {{0, 0}, {size, 0}, {size, across}, {0, across}};
    Eigen::Quaterniond turn(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    turn.normalize();
    const double away = one(2) ? size * std::pow(10, uniform(0, 5)) : 0;
    const Vec3 centre = away * Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    const double grain = size * std::pow(10, -uniform(2, 16));  // as a number of decimals
    const auto rounded = [&](const Vec3& x) {
      Vec3 r;
      for (int k = 0; k < 3; ++k) r[k] = std::round(x[k] / grain) * grain;
      return r;
    };
    Vec3 x[4];
    for (int i = 0; i < 4; ++i)
      x[i] =
          rounded(centre + turn * Vec3(plane[i][0] + shake * across * uniform(-1, 1),
                                       plane[i][1] + shake * across * uniform(-1, 1), warp * across * uniform(-1, 1)));
    if (one(20) == 0) x[3] = x[2];
    if (tiefmu::crossesItself(4, x) || tiefmu::zeroArea(4, x)) {
      ++c.crossing;
      continue;
    }
    static constexpr double ends[] = {-1, 1};
    const int kind = one(4);
    const double xi = kind == 0 ? ends[one(2)] : uniform(-1, 1) * (kind == 1 ? 1.5 : 1);
    const double eta = kind == 0 && one(2) ? ends[one(2)] : uniform(-1, 1) * (kind == 1 ? 1.5 : 1);
    const Vec3 a = 0.25 * ((1 - eta) * (x[1] - x[0]) + (1 + eta) * (x[2] - x[3])),
               b = 0.25 * ((1 - xi) * (x[3] - x[0]) + (1 + xi) * (x[2] - x[1]));
    const tiefmu::Phi phi = tiefmu::shape(4, xi, eta);
    Vec3 point = x[0];
    for (int i = 1; i < 4; ++i) point += phi[i] * (x[i] - x[0]);
    if (one(3) && a.cross(b).norm() > 0)
      point += size * std::pow(10, uniform(-12, 0)) * (one(2) ? 1 : -1) * a.cross(b).normalized();
    const Vec3 slave = rounded(point);

    ++c.tried;
    const tiefmu::Projection p = tiefmu::project(4, x, slave);
    Verdict verdict = judge(Oracle(x, slave, false), p);
    if (verdict.wrong || verdict.refused || verdict.missed) verdict = judge(Oracle(x, slave, true), p);
    c.folded += p.folded;
    c.missed += verdict.missed;
    c.none += verdict.none;
    c.doubtful += verdict.doubtful;
    c.refused += verdict.refused;
    c.wrong += verdict.wrong;
    c.error = std::max(c.error, verdict.error);
    if (verdict.wrong || verdict.refused)
      std::printf("case %ld: aspect %.3g, warp %.3g, %s\n", c.tried, size / across, warp, verdict.line);
  }
  std::printf(
      "%ld quads: %ld refused, %ld wrong; %ld missed by the search itself, %ld without a projection within 1.5, %ld "
      "with two as near, %ld folded; "
      "%ld crossing or without area left out; largest error %.3Lg of what rounding allows\n",
      c.tried, c.refused, c.wrong, c.missed, c.none, c.doubtful, c.folded, c.crossing, c.error);
  return c.refused + c.wrong > 0;
}
