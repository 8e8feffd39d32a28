#include "tie.hpp"

namespace tiefmu {
namespace {

// One meanMotion segment and how its nodes' positions change.
struct MovingSegment {
  const SegmentFrame& frame;
  const int* node;
  int corners, first, last;  // slaves [first, last)
  Vec3 arm[4], dArm[4];
  Mat3 inverse;

  MovingSegment(const TieGroup& group, TieGeometry geometry, int e, const double* dx)
      : frame(geometry.frame[e]),
        node(&group.node[static_cast<std::size_t>(group.corners) * e]),
        corners(group.corners),
        first(group.firstSlave + group.begin[e]),
        last(group.firstSlave + group.begin[e + 1]) {
    Vec3 centre(0, 0, 0);
    for (int i = 0; i < corners; ++i) centre += at(dx, node[i]) / corners;
    for (int i = 0; i < corners; ++i) {
      arm[i] = at(frame.arm, i);
      dArm[i] = at(dx, node[i]) - centre;
    }
    inverse = Eigen::Map<const Mat3>(frame.inverse);
  }

  // (sum 2 (p.q) 1 - q p^T - p q^T) y: change of Ibar for arms p that change by q, times y.
  Vec3 inertiaDerivative(const Vec3* p, const Vec3* q, const Vec3& y) const {
    Vec3 sum(0, 0, 0);
    for (int i = 0; i < corners; ++i) sum += 2 * p[i].dot(q[i]) * y - p[i].dot(y) * q[i] - q[i].dot(y) * p[i];
    return sum;
  }
  // w = Ibar^-1 sum r x u, and its change: Ibar dw = sum dr x u - dIbar w
  Vec3 spin(const double* u) const {
    Vec3 sum(0, 0, 0);
    for (int i = 0; i < corners; ++i) sum += arm[i].cross(at(u, node[i]));
    return inverse * sum;
  }
  Vec3 spinDerivative(const double* u) const {
    Vec3 sum(0, 0, 0);
    for (int i = 0; i < corners; ++i) sum += dArm[i].cross(at(u, node[i]));
    return inverse * (sum - inertiaDerivative(arm, dArm, spin(u)));
  }
};

template <class Body> void eachMovingSegment(const TieGroup& group, TieGeometry geometry, const double* dx, Body body) {
  if (group.coupling != Coupling::meanMotion) return;
  for (int e = 0; e < group.segments(); ++e) body(MovingSegment(group, geometry, e, dx));
}

}  // namespace

void mapMotionDerivative(const TieGroup& group, TieGeometry geometry, const double* dx, const double* u, double* us,
                         double* turns) {
  eachMovingSegment(group, geometry, dx, [&](const MovingSegment& segment) {
    const Vec3 dw = segment.spinDerivative(u);
    for (int s = segment.first; s < segment.last; ++s) {
      at(us, s) += dw.cross(at(geometry.offset, s));
      at(turns, s) += dw;
    }
  });
}

void distributeLoadsDerivative(const TieGroup& group, TieGeometry geometry, const double* dx, const double* force,
                               const double* moment, double* f) {
  eachMovingSegment(group, geometry, dx, [&](const MovingSegment& segment) {
    Vec3 sum(0, 0, 0);
    for (int s = segment.first; s < segment.last; ++s)
      sum += at(moment, s) + Vec3(at(geometry.offset, s)).cross(at(force, s));
    // f_i = F/n + A x r_i, Ibar A = sum
    const Vec3 A = segment.inverse * sum,
               dA = -segment.inverse * segment.inertiaDerivative(segment.arm, segment.dArm, A);
    for (int i = 0; i < segment.corners; ++i)
      at(f, segment.node[i]) += dA.cross(segment.arm[i]) + A.cross(segment.dArm[i]);
  });
}

void biasDerivative(const TieGroup& group, TieGeometry geometry, const double* dx, const double* velocity, double* as,
                    double* zs) {
  eachMovingSegment(group, geometry, dx, [&](const MovingSegment& segment) {
    const Vec3 w = segment.spin(velocity), dw = segment.spinDerivative(velocity);
    Vec3 centre(0, 0, 0), rate[4];
    for (int i = 0; i < segment.corners; ++i) centre += at(velocity, segment.node[i]) / segment.corners;
    for (int i = 0; i < segment.corners; ++i) rate[i] = at(velocity, segment.node[i]) - centre;
    // Ibar z = -Ibar' w, both sides changed
    const Vec3 z = -segment.inverse * segment.inertiaDerivative(segment.arm, rate, w);
    const Vec3 dz = -segment.inverse * (segment.inertiaDerivative(segment.dArm, rate, w) +
                                        segment.inertiaDerivative(segment.arm, rate, dw) +
                                        segment.inertiaDerivative(segment.arm, segment.dArm, z));
    for (int s = segment.first; s < segment.last; ++s) {
      const Vec3 d = at(geometry.offset, s);
      at(as, s) += dz.cross(d) + dw.cross(w.cross(d)) + w.cross(dw.cross(d));
      at(zs, s) += dz;
    }
  });
}

}  // namespace tiefmu
