#include "spring.hpp"

#include <algorithm>

namespace tiefmu {

SpringLoad springLoad(const Spring& spring, const EndMotion& a, const EndMotion& b) {
  SpringLoad load;
  const Vec3 line = a.x - b.x;
  if (spring.kind == SpringKind::axial) {
    const double length = line.norm();
    const Vec3 direction = length > 0 ? Vec3(line / length) : Vec3(0, 0, 0);
    const double elongation = length - spring.length, rate = direction.dot(a.v - b.v);
    load.fb = (spring.stiffness[0] * elongation + spring.damping[0] * rate) * direction;
    load.fa = -load.fb;
    load.energy = 0.5 * spring.stiffness[0] * elongation * elongation;
    load.dissipation = spring.damping[0] * rate * rate;
    return load;
  }
  const Vec3 shift = line - b.q * spring.arm;
  const Vec3 rate = a.v - b.v - b.w.cross(line);
  const Vec3 turn = logarithm(b.q * a.q.conjugate());
  const Vec3 spin = b.w - a.w;
  load.fb = spring.stiffness.cwiseProduct(shift) + spring.damping.cwiseProduct(rate);
  load.fa = -load.fb;
  load.ta = spring.rotationalStiffness.cwiseProduct(turn) + spring.rotationalDamping.cwiseProduct(spin);
  load.tb = line.cross(load.fb) - load.ta;
  load.energy =
      0.5 * (shift.dot(spring.stiffness.cwiseProduct(shift)) + turn.dot(spring.rotationalStiffness.cwiseProduct(turn)));
  load.dissipation =
      rate.dot(spring.damping.cwiseProduct(rate)) + spin.dot(spring.rotationalDamping.cwiseProduct(spin));
  return load;
}

SpringLoad springTangent(const Spring& spring, const EndMotion& a, const EndMotion& b, bool damping) {
  SpringLoad load;
  const Vec3 line = a.x - b.x;
  if (spring.kind == SpringKind::axial) {
    const double length = line.norm();
    if (!(length > 0)) return load;
    const Vec3 direction = line / length, gap = a.v - b.v;
    const double along = direction.dot(gap);
    if (damping) {
      load.fb = spring.damping[0] * along * direction;
    } else {
      // A compressed spring's negative transverse stiffness lowers frequencies; leaving it out is the safe side.
      const double transverse = std::max(0.0, spring.stiffness[0] * (1 - spring.length / length));
      load.fb = transverse * gap + (spring.stiffness[0] - transverse) * along * direction;
    }
    load.fa = -load.fb;
    return load;
  }
  const Vec3 arm = b.q * spring.arm;
  const Vec3 shift = a.v - b.v - b.w.cross(arm), turn = b.w - a.w;
  load.fb = (damping ? spring.damping : spring.stiffness).cwiseProduct(shift);
  load.fa = -load.fb;
  load.ta = (damping ? spring.rotationalDamping : spring.rotationalStiffness).cwiseProduct(turn);
  load.tb = arm.cross(load.fb) - load.ta;
  return load;
}

SpringLoad springLoadDerivative(const Spring& spring, const EndMotion& a, const EndMotion& b, const EndMotion& da,
                                const EndMotion& db) {
  SpringLoad change;
  const Vec3 line = a.x - b.x, dLine = da.x - db.x;
  if (spring.kind == SpringKind::axial) {
    const double length = line.norm();
    if (!(length > 0)) return change;
    const Vec3 n = line / length, dn = (dLine - n.dot(dLine) * n) / length;
    const double k = spring.stiffness[0], c = spring.damping[0], elongation = length - spring.length;
    const double tension = k * elongation + c * n.dot(a.v - b.v);
    const double dTension = k * n.dot(dLine) + c * (dn.dot(a.v - b.v) + n.dot(da.v - db.v));
    change.fb = dTension * n + tension * dn;
    change.fa = -change.fb;
    change.energy = k * elongation * n.dot(dLine);
    return change;
  }
  const SpringLoad load = springLoad(spring, a, b);
  const Vec3 dRate = da.v - db.v - db.w.cross(line) - b.w.cross(dLine);
  const Vec3 elastic = spring.stiffness.cwiseProduct(line - b.q * spring.arm);
  change.fb = spring.stiffness.cwiseProduct(dLine) + spring.damping.cwiseProduct(dRate);
  change.fa = -change.fb;
  change.ta = spring.rotationalDamping.cwiseProduct(db.w - da.w);
  change.tb = dLine.cross(load.fb) + line.cross(change.fb) - change.ta;
  change.energy = elastic.dot(dLine);
  return change;
}

}  // namespace tiefmu
