#include "tie.hpp"

namespace tiefmu {
namespace {

// The values of three components at the corners of a segment, or what belongs to each corner.
using Corners = Vec3[4];

// One meanMotion segment: its arms r_i and Ibar^-1. They change with the nodes' positions: r_i by dr_i, the positions'
// change without its mean.
struct MeanSegment {
  const int* node;
  int corners, first, last;  // slaves [first, last)
  Corners arm;
  Mat3 inverse;

  MeanSegment(const TieGroup& group, TieGeometry geometry, int e)
      : node(&group.node[static_cast<std::size_t>(group.corners) * e]),
        corners(group.corners),
        first(group.firstSlave + group.begin[e]),
        last(group.firstSlave + group.begin[e + 1]) {
    const SegmentFrame& frame = geometry.frame[e];
    for (int i = 0; i < corners; ++i) arm[i] = at(frame.arm, i);
    inverse = Eigen::Map<const Mat3>(frame.inverse);
  }

  // Values at the corners without their mean, and the transpose, added to `u`.
  void centred(const double* u, Corners& to) const {
    Vec3 mean(0, 0, 0);
    for (int i = 0; i < corners; ++i) mean += at(u, node[i]) / corners;
    for (int i = 0; i < corners; ++i) to[i] = at(u, node[i]) - mean;
  }
  void addCentred(const Corners& from, double* u) const {
    Vec3 mean(0, 0, 0);
    for (int i = 0; i < corners; ++i) mean += from[i] / corners;
    for (int i = 0; i < corners; ++i) at(u, node[i]) += from[i] - mean;
  }

  // sum p_i x u_i
  Vec3 momentum(const Corners& p, const double* u) const {
    Vec3 sum(0, 0, 0);
    for (int i = 0; i < corners; ++i) sum += p[i].cross(at(u, node[i]));
    return sum;
  }
  Vec3 spin(const double* u) const { return inverse * momentum(arm, u); }

  // D y with D = sum 2 (p.q) 1 - q p^T - p q^T, a symmetric matrix: the change of Ibar for arms p that change by q.
  Vec3 inertiaDerivative(const Corners& p, const Corners& q, const Vec3& y) const {
    Vec3 sum(0, 0, 0);
    for (int i = 0; i < corners; ++i) sum += 2 * p[i].dot(q[i]) * y - p[i].dot(y) * q[i] - q[i].dot(y) * p[i];
    return sum;
  }
  // The gradient of z.(D y) along q_i.
  static Vec3 inertiaGradient(const Vec3& p, const Vec3& y, const Vec3& z) {
    return 2 * y.dot(z) * p - p.dot(y) * z - p.dot(z) * y;
  }

  // The power of loads on slaves whose moments add up to Ibar A, in a motion u of the nodes with the spin w, changes
  // with the arms by A.(sum dr_i x u_i - dIbar w): its gradient, scaled, is added to `u`.
  void addPowerGradient(const Vec3& A, const Vec3& w, const double* u, double* dx) const {
    Corners gradient;
    for (int i = 0; i < corners; ++i) gradient[i] = Vec3(at(u, node[i])).cross(A) - inertiaGradient(arm[i], w, A);
    addCentred(gradient, dx);
  }
  // sum over the slaves of M + d x F
  Vec3 momentOf(TieGeometry geometry, const double* force, const double* moment) const {
    Vec3 sum(0, 0, 0);
    for (int s = first; s < last; ++s) sum += at(moment, s) + Vec3(at(geometry.offset, s)).cross(at(force, s));
    return sum;
  }
};

template <class Body> void eachMeanSegment(const TieGroup& group, TieGeometry geometry, Body body) {
  if (group.coupling != Coupling::meanMotion) return;
  for (int e = 0; e < group.segments(); ++e) body(MeanSegment(group, geometry, e));
}

// Of a meanMotion segment: w changes by dw, z_b of theory (2.8) by dz.
void meanBias(Way way, const MeanSegment& segment, TieGeometry geometry, const double* velocity,
              const MotionChange& change, double* as, double* zs) {
  const int corners = segment.corners;
  const Mat3& inverse = segment.inverse;
  Corners rate;
  segment.centred(velocity, rate);
  const Vec3 w = segment.spin(velocity);
  const Vec3 z = -inverse * segment.inertiaDerivative(segment.arm, rate, w);
  if (way == Way::forward) {
    // Ibar w = sum r x v and Ibar z = -Ibar' w, all changed.
    Corners dArm, dRate;
    segment.centred(change.v, dRate);
    Vec3 sum = segment.momentum(segment.arm, change.v);
    if (change.x) {
      segment.centred(change.x, dArm);
      sum += segment.momentum(dArm, velocity) - segment.inertiaDerivative(segment.arm, dArm, w);
    }
    const Vec3 dw = inverse * sum;
    sum = segment.inertiaDerivative(segment.arm, dRate, w) + segment.inertiaDerivative(segment.arm, rate, dw);
    if (change.x) sum += segment.inertiaDerivative(dArm, rate, w) + segment.inertiaDerivative(segment.arm, dArm, z);
    const Vec3 dz = -inverse * sum;
    for (int s = segment.first; s < segment.last; ++s) {
      const Vec3 d = at(geometry.offset, s);
      at(as, s) += dz.cross(d) + centripetalDerivative(w, dw, d);
      at(zs, s) += dz;
    }
    return;
  }
  Vec3 onZ(0, 0, 0), onW(0, 0, 0);
  for (int s = segment.first; s < segment.last; ++s) {
    const Vec3 d = at(geometry.offset, s), a = at(as, s);
    onZ += at(zs, s) + d.cross(a);
    onW += centripetalGradient(w, d, a);
  }
  const Vec3 y = -inverse * onZ;
  const Vec3 u = inverse * (onW + segment.inertiaDerivative(segment.arm, rate, y));
  Corners onRate, onArm;
  for (int i = 0; i < corners; ++i) {
    onRate[i] = MeanSegment::inertiaGradient(segment.arm[i], w, y);
    at(change.v, segment.node[i]) += u.cross(segment.arm[i]);
  }
  segment.addCentred(onRate, change.v);
  if (!change.x) return;
  for (int i = 0; i < corners; ++i)
    onArm[i] = MeanSegment::inertiaGradient(rate[i], w, y) + MeanSegment::inertiaGradient(segment.arm[i], z, y);
  segment.addCentred(onArm, change.x);
  segment.addPowerGradient(u, w, velocity, change.x);
}

}  // namespace

void mapMotionDerivative(Way way, const TieGroup& group, TieGeometry geometry, double* dx, const double* u, double* us,
                         double* turns) {
  eachMeanSegment(group, geometry, [&](const MeanSegment& segment) {
    const Vec3 w = segment.spin(u);
    if (way == Way::transposed)
      return segment.addPowerGradient(segment.inverse * segment.momentOf(geometry, us, turns), w, u, dx);
    Corners dArm;
    segment.centred(dx, dArm);
    const Vec3 dw = segment.inverse * (segment.momentum(dArm, u) - segment.inertiaDerivative(segment.arm, dArm, w));
    for (int s = segment.first; s < segment.last; ++s) {
      at(us, s) += dw.cross(at(geometry.offset, s));
      at(turns, s) += dw;
    }
  });
}

void distributeLoadsDerivative(Way way, const TieGroup& group, TieGeometry geometry, double* dx, const double* force,
                               const double* moment, double* f) {
  eachMeanSegment(group, geometry, [&](const MeanSegment& segment) {
    // f_i = F/n + A x r_i
    const Vec3 A = segment.inverse * segment.momentOf(geometry, force, moment);
    if (way == Way::transposed) return segment.addPowerGradient(A, segment.spin(f), f, dx);
    Corners dArm;
    segment.centred(dx, dArm);
    const Vec3 dA = -segment.inverse * segment.inertiaDerivative(segment.arm, dArm, A);
    for (int i = 0; i < segment.corners; ++i) at(f, segment.node[i]) += dA.cross(segment.arm[i]) + A.cross(dArm[i]);
  });
}

void biasDerivative(Way way, const TieGroup& group, TieGeometry geometry, const double* velocity, const double* spin,
                    const MotionChange& change, double* as, double* zs) {
  eachMeanSegment(group, geometry,
                  [&](const MeanSegment& segment) { meanBias(way, segment, geometry, velocity, change, as, zs); });
  if (group.coupling != Coupling::rotation) return;
  const int n = group.corners;
  for (int e = 0; e < group.segments(); ++e) {
    const int* node = &group.node[static_cast<std::size_t>(n) * e];
    for (int k = group.begin[e]; k < group.begin[e + 1]; ++k) {
      const double* phi = &group.weight[static_cast<std::size_t>(n) * k];
      const int s = group.firstSlave + k;
      const Vec3 d = at(geometry.offset, s);
      Vec3 w(0, 0, 0), dw(0, 0, 0);
      for (int i = 0; i < n; ++i) w += phi[i] * at(spin, node[i]);
      if (way == Way::forward) {
        for (int i = 0; i < n; ++i) dw += phi[i] * at(change.w, node[i]);
        at(as, s) += centripetalDerivative(w, dw, d);
      } else {
        dw = centripetalGradient(w, d, at(as, s));
        for (int i = 0; i < n; ++i) at(change.w, node[i]) += phi[i] * dw;
      }
    }
  }
}

}  // namespace tiefmu
