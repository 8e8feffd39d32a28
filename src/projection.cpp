// Closest points of a bilinear quad and of a triangle (theory 7).
//
// P(xi, eta) = c0 + xi c1 + eta c2 + xi eta c3; A = dP/dxi = c1 + eta c3, B = dP/deta = c2 + xi c3, r = S - P.
// A stationary point of |r|^2 has r.A = r.B = 0. From one such point u*, any other point u is farther by
//   |S - P(u)|^2 - |r*|^2 = |dP|^2 - 2 k* dxi deta,   k* = r*.c3,   dP = A' dxi + B' deta,
// with A' and B' taken halfway between the two. So with K a lower bound of |A||B| - |A.B| over a box,
//   |k*| < K: u* is the closest point of the box, and the only one;
//   two stationary points of the box have k1 + k2 = |dP|^2 / (dxi deta) of at least 2 K in size, where
//   |k| = |r| |V| / |A x B| <= |r| |V| / K with V = (c1 x c2).c3, which vanishes for a plane quad.
// Nearly every quad of a mesh passes that test, and Newton's answer from the centre is the one. Else all stationary
// points are found: minimising over xi at fixed eta leaves a polynomial of degree 5 in eta.
#include <algorithm>
#include <limits>

#include "segment.hpp"

namespace tiefmu {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double rounding = std::numeric_limits<double>::epsilon();
constexpr double reach = Projection::farthest;  // stationary points beyond do not count
constexpr double edge = 1 + 1e-10;              // inside up to rounding

// S - Q for the closest point Q of the edge from a to a + u.
Vec3 toEdge(const Vec3& s, const Vec3& a, const Vec3& u) {
  const Vec3 r = s - a;
  const double length2 = u.squaredNorm();
  return length2 > 0 ? Vec3(r - std::clamp(r.dot(u) / length2, 0.0, 1.0) * u) : r;
}

// The quad and the slave, from the quad's first corner.
struct Quad {
  Vec3 x[4], slave;    // corners and slave
  Vec3 s, c1, c2, c3;  // slave from c0, and the map
  double size, size2;  // longest diagonal
  double s1, s2, s3, g11, g12, g13, g22, g23, g33;

  Quad(const Vec3* corner, const Vec3& point) {
    x[0].setZero();
    for (int i = 1; i < 4; ++i) x[i] = corner[i] - corner[0];
    slave = point - corner[0];
    const Vec3 opposite = corner[2] - corner[3], across = corner[2] - corner[1];
    c1 = 0.25 * (x[1] + opposite);
    c2 = 0.25 * (x[3] + across);
    c3 = 0.25 * (opposite - x[1]);
    s = slave - 0.25 * (x[1] + x[2] + x[3]);
    size2 = std::max(x[2].squaredNorm(), (corner[3] - corner[1]).squaredNorm());
    size = std::sqrt(size2);
    s1 = s.dot(c1), s2 = s.dot(c2), s3 = s.dot(c3);
    g11 = c1.squaredNorm(), g22 = c2.squaredNorm(), g33 = c3.squaredNorm();
    g12 = c1.dot(c2), g13 = c1.dot(c3), g23 = c2.dot(c3);
  }

  Vec3 offset(double xi, double eta) const { return s - xi * (c1 + eta * c3) - eta * c2; }

  // Lower bound of |A||B| - |A.B| for |xi|, |eta| <= m; negative: unknown.
  double regularity(double m) const {
    const double twist = m * std::sqrt(g33), a = std::sqrt(g11) - twist, b = std::sqrt(g22) - twist;
    if (!(a > 0 && b > 0)) return -1;
    return a * b - std::abs(g12) - m * (std::abs(g13) + std::abs(g23)) - m * m * g33;
  }

  // Upper bound of |r| for |xi|, |eta| <= reach.
  double farthestOffset() const {
    return s.norm() + reach * (std::sqrt(g11) + std::sqrt(g22) + reach * std::sqrt(g33));
  }

  double volume() const { return c1.cross(c2).dot(c3); }

  Vec3 toEdges() const {
    Vec3 best = toEdge(slave, x[0], x[1]);
    for (int i = 1; i < 4; ++i) {
      const Vec3 r = toEdge(slave, x[i], x[(i + 1) % 4] - x[i]);
      if (r.squaredNorm() < best.squaredNorm()) best = r;
    }
    return best;
  }

  // Farther than `limit` for certain: beyond the planes that bound its corners' hull.
  bool fartherThan(double limit) const {
    const Vec3 normal = c1.cross(c2).normalized();
    const auto beyond = [&](const Vec3& direction) {
      double most = 0;  // of the first corner
      for (int i = 1; i < 4; ++i) most = std::max(most, direction.dot(x[i]));
      return std::max(direction.dot(slave) - most, 0.0);
    };
    const double above = beyond(normal) + beyond(-normal);
    double beside = 0;
    for (int i = 0; i < 4; ++i) {
      const Vec3 out = (x[(i + 1) % 4] - x[i]).cross(normal);
      const double length = out.norm();
      if (length > 0) beside = std::max(beside, beyond(out / length));
    }
    return above * above + beside * beside > limit * limit;
  }
};

struct Stationary {
  double xi = 0, eta = 0;
  double outside() const { return std::max(std::abs(xi), std::abs(eta)); }
};

// Newton's steps to a stationary point, from products of vectors alone; then one from the vectors, whose residual is
// as exact as the coordinates. Stops on the length of a step on the surface: quadratic convergence makes the next one
// smaller than rounding, of the segment's size or of the slave's distance. False: to be looked at more closely.
bool newton(const Quad& q, Stationary& u) {
  double xi = 0, eta = 0;
  const double small = 1e-8 * q.size + 16 * rounding * q.s.norm();
  bool close = false;
  for (int iteration = 0; iteration < 12 && !close; ++iteration) {
    const double h00 = q.g11 + eta * (2 * q.g13 + eta * q.g33), h11 = q.g22 + xi * (2 * q.g23 + xi * q.g33);
    const double f0 = q.s1 + eta * q.s3 - xi * h00 - eta * (q.g12 + eta * q.g23);
    const double f1 = q.s2 + xi * q.s3 - eta * h11 - xi * (q.g12 + xi * q.g13);
    const double cross = q.g12 + xi * q.g13 + eta * q.g23 + xi * eta * q.g33;
    double h01 = cross - (q.s3 - xi * q.g13 - eta * q.g23 - xi * eta * q.g33);
    double det = h00 * h11 - h01 * h01;
    if (!(det > 1e-10 * h00 * h11)) {
      h01 = cross;
      det = h00 * h11 - h01 * h01;
      if (!(det > 1e-10 * h00 * h11)) return false;
    }
    const double dXi = (h11 * f0 - h01 * f1) / det, dEta = (h00 * f1 - h01 * f0) / det;
    xi += dXi;
    eta += dEta;
    if (!(std::abs(xi) < 100 && std::abs(eta) < 100)) return false;
    const double step2 = h00 * dXi * dXi + 2 * cross * dXi * dEta + h11 * dEta * dEta;
    close = step2 <= small * small && std::abs(dXi) + std::abs(dEta) < 1e-6;
  }
  if (!close) return false;
  u = {xi, eta};
  return true;
}

// One Newton step from the vectors themselves. False where the Hessian is not safely positive definite.
bool refine(const Quad& q, Stationary& u, double most) {
  const Vec3 a = q.c1 + u.eta * q.c3, b = q.c2 + u.xi * q.c3, r = q.s - u.xi * a - u.eta * q.c2;
  const double h00 = a.squaredNorm(), h11 = b.squaredNorm(), h01 = a.dot(b) - r.dot(q.c3);
  const double det = h00 * h11 - h01 * h01;
  if (!(det > 1e-12 * h00 * h11)) return false;
  const double f0 = r.dot(a), f1 = r.dot(b);
  const double dXi = (h11 * f0 - h01 * f1) / det, dEta = (h00 * f1 - h01 * f0) / det;
  if (!(std::abs(dXi) <= most && std::abs(dEta) <= most)) return false;
  u.xi += dXi;
  u.eta += dEta;
  return true;
}

// Where the Hessian is singular (the map folds there): damped Gauss-Newton, as long as the offset shrinks.
void settle(const Quad& q, Stationary& u) {
  for (int iteration = 0; iteration < 60; ++iteration) {
    const Vec3 a = q.c1 + u.eta * q.c3, b = q.c2 + u.xi * q.c3, r = q.s - u.xi * a - u.eta * q.c2;
    const double damping = 1 + 1e-12;
    const double h00 = a.squaredNorm() * damping + 1e-30 * q.size2, h11 = b.squaredNorm() * damping + 1e-30 * q.size2;
    const double h01 = a.dot(b), det = h00 * h11 - h01 * h01, f0 = r.dot(a), f1 = r.dot(b);
    const Stationary next{u.xi + (h11 * f0 - h01 * f1) / det, u.eta + (h00 * f1 - h01 * f0) / det};
    if (!(next.outside() <= 2 * reach) || !(q.offset(next.xi, next.eta).squaredNorm() < r.squaredNorm())) return;
    u = next;
  }
}

// Roots of a polynomial in Bernstein form on [low, high], by halving until Descartes' rule leaves one sign change.
struct Roots {
  double root[8];
  int count = 0;

  static double at(const double* c, double t) {
    double b[6];
    std::copy_n(c, 6, b);
    for (int k = 5; k > 0; --k)
      for (int i = 0; i < k; ++i) b[i] += t * (b[i + 1] - b[i]);
    return b[0];
  }

  void find(const double* c, double low, double high) {
    int changes = 0;
    double last = 0;
    for (int i = 0; i < 6; ++i)
      if (c[i] != 0) {
        changes += last * c[i] < 0;
        last = c[i] > 0 ? 1 : -1;
      }
    if (changes == 0 && c[0] != 0 && c[5] != 0) return;
    if (count == 8) return;
    if (changes == 0 || high - low < 1e-10) {  // roots at an end, or several in one place
      if (c[0] == 0 || high - low < 1e-10) root[count++] = low;
      if (c[5] == 0 && count < 8 && high - low >= 1e-10) root[count++] = high;
      return;
    }
    if (changes == 1 && c[0] * c[5] < 0) {
      double a = 0, b = 1;
      for (int k = 0; k < 60 && b - a > 1e-15; ++k) {
        const double middle = 0.5 * (a + b);
        (at(c, middle) * c[0] > 0 ? a : b) = middle;
      }
      root[count++] = low + 0.5 * (a + b) * (high - low);
      return;
    }
    double left[6], right[6], b[6];
    std::copy_n(c, 6, b);
    for (int k = 0; k < 6; ++k) {
      left[k] = b[0];
      right[5 - k] = b[5 - k];
      for (int i = 0; i + k < 5; ++i) b[i] = 0.5 * (b[i] + b[i + 1]);
    }
    const double middle = 0.5 * (low + high);
    find(left, low, middle);
    find(right, middle, high);
  }
};

// All local minima with |xi|, |eta| <= reach. The line of fixed eta through a = s - eta c2 with direction
// b = c1 + eta c3 has its closest point at xi = a.b / b.b; that is stationary in eta, too, where
//   ((b.b) a - (a.b) b) . ((b.b) c2 + (a.b) c3) = 0.
int minima(const Quad& q, Stationary* found) {
  const auto shortest = [&](double g, double gt) {  // the square of the shortest |c + t c3|, over c.c
    const double t = q.g33 > 0 ? std::clamp(-gt / q.g33, -reach, reach) : 0;
    return (g + t * (2 * gt + t * q.g33)) / g;
  };
  const bool swapped = !(shortest(q.g11, q.g13) >= shortest(q.g22, q.g23));
  const double scale = 1 / q.size;  // no overflow whatever the unit
  const Vec3 s = scale * q.s, c1 = scale * (swapped ? q.c2 : q.c1), c2 = scale * (swapped ? q.c1 : q.c2),
             c3 = scale * q.c3;
  const Vec3 a[2] = {s, -c2}, b[2] = {c1, c3};
  const double w[3] = {s.dot(c1), s.dot(c3) - c2.dot(c1), -c2.dot(c3)};
  const double d[3] = {c1.squaredNorm(), 2 * c1.dot(c3), c3.squaredNorm()};
  Vec3 u[4] = {Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), Vec3::Zero()}, v[3];
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 3; ++j) u[i + j] += d[j] * a[i] - w[j] * b[i];
  for (int j = 0; j < 3; ++j) v[j] = d[j] * c2 + w[j] * c3;
  double power[6] = {}, bernstein[6];
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 3; ++j) power[i + j] += u[i].dot(v[j]);
  // to t in [0, 1] with eta = reach (2 t - 1), then to Bernstein form
  const double low = -reach * edge, width = -2 * low;
  for (int i = 0; i < 6; ++i)
    for (int j = 4; j >= i; --j) power[j] += low * power[j + 1];
  double factor = 1;
  for (double& p : power) {
    p *= factor;
    factor *= width;
  }
  static constexpr double choose[6][6] = {{1}, {1, 1}, {1, 2, 1}, {1, 3, 3, 1}, {1, 4, 6, 4, 1}, {1, 5, 10, 10, 5, 1}};
  for (int k = 0; k < 6; ++k) {
    bernstein[k] = 0;
    for (int i = 0; i <= k; ++i) bernstein[k] += choose[k][i] / choose[5][i] * power[i];
  }
  Roots roots;
  roots.find(bernstein, low, -low);

  int count = 0;
  for (int k = 0; k < roots.count; ++k) {
    const double t = roots.root[k], b2 = d[0] + t * (d[1] + t * d[2]);
    if (!(b2 > 0)) continue;
    const double along = (w[0] + t * (w[1] + t * w[2])) / b2;
    Stationary p = swapped ? Stationary{t, along} : Stationary{along, t};
    if (!(p.outside() <= 1.1 * reach)) continue;
    int steps = 0;
    while (steps < 8 && refine(q, p, 1e-2)) ++steps;
    if (steps == 0) {
      const Vec3 x = q.c1 + p.eta * q.c3, y = q.c2 + p.xi * q.c3;
      const double h01 = x.dot(y) - q.offset(p.xi, p.eta).dot(q.c3), h = x.squaredNorm() * y.squaredNorm();
      if (h - h01 * h01 < -1e-4 * h) continue;  // a saddle
      settle(q, p);
    }
    if (p.outside() <= reach * edge) found[count++] = p;
  }
  return count;
}

// Two corners in one place: a triangle, whose share of the common corner the two nodes divide as the bilinear map
// does. The map has every xi (or eta) there; weights stay what they are a step away, within its reach.
bool collapsed(const Quad& q, double noise, Projection& p) {
  int pair = -1;
  for (int i = 0; i < 4; ++i)
    if ((q.x[(i + 1) % 4] - q.x[i]).norm() <= std::max(1e-12 * q.size, noise)) pair = i;
  if (pair < 0) return false;
  const int next = (pair + 1) % 4, right = (pair + 2) % 4, left = (pair + 3) % 4;
  const Vec3 corner[3] = {q.x[pair], q.x[left], q.x[right]};
  const Projection t = project(3, corner, q.slave);
  p.converged = t.converged;
  p.offset = t.offset;
  p.distance = t.distance;
  p.toNearest = t.toNearest;
  p.nearest = t.nearest;
  const double apex = t.phi[0], base = t.phi[1] + t.phi[2];
  double along = std::abs(base) > 1e-12 ? (t.phi[2] - t.phi[1]) / base : 0;
  const bool near = std::abs(along) <= reach;
  if (!near) along = std::clamp(along, -1.0, 1.0);
  p.phi[pair] = 0.5 * (1 - along) * apex;
  p.phi[next] = 0.5 * (1 + along) * apex;
  p.phi[right] = t.phi[2];
  p.phi[left] = t.phi[1];
  p.xi = p.phi[1] + p.phi[2] - p.phi[0] - p.phi[3];
  p.eta = p.phi[2] + p.phi[3] - p.phi[0] - p.phi[1];
  p.outside = near ? std::max(std::abs(p.xi), std::abs(p.eta)) : t.outside;
  return true;
}

// Beside an inward corner (of a chevron) the surface lies over itself, seen along its mean normal m = c1 x c2. There,
// no answer is right. With J = m.(A x B) = j0 + xi j1 + eta j2, what is turned over has J < 0, and what it lies over
// are the u whose other point of the same place, u - J (1 / j1, 1 / j2), belongs to the quad, too. A corner that is
// inward by less than a hundredth counts as straight. A quad that passes the test in `quad` has J > 0 everywhere.
bool folds(const Quad& q, const Stationary& u) {
  constexpr double straight = 1e-2;
  const Vec3 m = q.c1.cross(q.c2);
  const double j0 = m.squaredNorm(), j1 = m.dot(q.c1.cross(q.c3)), j2 = m.dot(q.c3.cross(q.c2));
  if (j0 - std::abs(j1) - std::abs(j2) > -straight * j0) return false;
  const double j = j0 + u.xi * j1 + u.eta * j2;
  return j <= 0 || Stationary{u.xi - j / j1, u.eta - j / j2}.outside() <= edge;
}

void complete(const Quad& q, const Stationary& u, Projection& p) {
  p.converged = true;
  p.xi = u.xi;
  p.eta = u.eta;
  p.outside = u.outside();
  p.offset = q.offset(u.xi, u.eta);
  p.distance = p.offset.norm();
  p.phi = shape(4, u.xi, u.eta);
}

Projection quad(const Vec3* corner, const Vec3& slave, double within) {
  const Quad q(corner, slave);
  Projection p;
  Stationary u;
  if (newton(q, u)) {
    refine(q, u, 1e-4);
    complete(q, u, p);
    const bool inside = p.outside <= 1;
    p.toNearest = inside ? p.offset : q.toEdges();
    p.nearest = inside ? p.distance : p.toNearest.norm();
    const double bound = q.regularity(inside ? 1 : std::max(reach, 0.5 * (reach + p.outside)));
    // No other one inside that is nearer than the edges; where this one does not count, none at all within reach.
    const double most = p.outside <= reach ? p.nearest : q.farthestOffset();
    const double curved = std::abs(p.offset.dot(q.c3)) + most * std::abs(q.volume()) / bound;
    if (bound > 0 && curved < 2 * bound && p.distance <= p.nearest * edge) return p;
  }
  p = Projection();
  if (within < infinity && q.fartherThan(within)) return p;
  double most = 0;
  for (int i = 0; i < 4; ++i) most = std::max(most, corner[i].cwiseAbs().maxCoeff());
  if (collapsed(q, 4 * rounding * most, p)) return p;

  p.toNearest = q.toEdges();
  p.nearest = p.toNearest.norm();
  Stationary found[8];
  const int count = minima(q, found);
  const double slack = 1e-10 * q.size;
  const Stationary* best = nullptr;
  double distance = infinity;
  const auto choose = [&](double limit) {
    for (int k = 0; k < count; ++k) {
      if (found[k].outside() > limit) continue;
      const double d = q.offset(found[k].xi, found[k].eta).norm();
      if (!best || d < distance - slack || (d <= distance + slack && found[k].outside() < best->outside())) {
        best = &found[k];
        distance = d;
      }
    }
  };
  choose(1);
  if (best && distance < p.nearest) {
    p.toNearest = q.offset(best->xi, best->eta);
    p.nearest = distance;
  } else if (!best || distance > p.nearest + slack) {
    best = nullptr;
    choose(reach * edge);
    if (!best) return p;
  }
  complete(q, *best, p);
  p.folded = p.outside <= edge && folds(q, *best);
  return p;
}

Projection triangle(const Vec3* corner, const Vec3& slave) {
  Projection p;
  const Vec3 u = corner[1] - corner[0], v = corner[2] - corner[0], s = slave - corner[0];
  const Vec3 normal = u.cross(v);
  const double area2 = normal.squaredNorm();
  p.toNearest = toEdge(s, Vec3::Zero(), u);
  for (const Vec3& r : {toEdge(s, Vec3::Zero(), v), toEdge(s, u, v - u)})
    if (r.squaredNorm() < p.toNearest.squaredNorm()) p.toNearest = r;
  p.converged = area2 > 0;
  if (p.converged) {
    p.xi = s.cross(v).dot(normal) / area2;
    p.eta = u.cross(s).dot(normal) / area2;
    p.phi = shape(3, p.xi, p.eta);
    p.offset = s - p.xi * u - p.eta * v;
    p.distance = p.offset.norm();
    p.outside = 1 - 2 * std::min({p.phi[0], p.phi[1], p.phi[2]});
    if (p.outside <= 1) p.toNearest = p.offset;
  }
  p.nearest = p.toNearest.norm();
  return p;
}

}  // namespace

Projection project(int n, const Vec3* corner, const Vec3& slave, double within) {
  return n == 4 ? quad(corner, slave, within) : triangle(corner, slave);
}

}  // namespace tiefmu
