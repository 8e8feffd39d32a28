#include "spring.hpp"

#include <algorithm>

namespace tiefmu {

namespace {

// How a beam stands, theory (3.15): its ends' relative rotation and the axes half-way between them.
class Beam {
 public:
  Beam(const Spring& spring, const EndMotion& a, const EndMotion& b) : line(a.x - b.x) {
    const Quat relative = b.q * a.q.conjugate();
    const double sign = relative.w() < 0 ? -1.0 : 1.0;
    turn = logarithm(relative);
    Quat middle(a.q.coeffs() + sign * b.q.coeffs());
    middle.coeffs() /= middle.norm();
    const Vec3 across = middle * spring.across;
    axes.col(0) = middle * spring.along;
    axes.col(1) = across;
    axes.col(2) = axes.col(0).cross(across);
    shift = axes.transpose() * line;
    shift[0] -= spring.length;
    // Functions of the half angle h: (h/sin h - 1)/(4 h^2) and tan(h/2)/(4 h).
    const double cosine = sign * relative.w(), h = 0.5 * turn.norm(), h2 = h * h;
    const double sinc = h < 1e-6 ? 1.0 : relative.vec().norm() / h;
    bend_ = h2 < 1e-3 ? (1.0 / 6 + h2 * (7.0 / 360 + h2 * (31.0 / 15120))) / 4 : (1 / sinc - 1) / (4 * h2);
    lean_ = sinc / (4 * (1 + cosine));
  }
  // Rate of the rotation vector in the axes half-way, from the difference of the spins; its own transpose.
  Vec3 turnRate(const Vec3& spin) const { return spin - bend_ * turn.cross(turn.cross(spin)); }
  // Spin of those axes.
  Vec3 middleSpin(const Vec3& wa, const Vec3& wb) const { return 0.5 * (wa + wb) - lean_ * turn.cross(wb - wa); }
  Vec3 shiftRate(const EndMotion& a, const EndMotion& b) const {
    return axes.transpose() * (a.v - b.v - middleSpin(a.w, b.w).cross(line));
  }
  Vec3 twist() const { return axes.transpose() * turn; }
  Vec3 twistRate(const EndMotion& a, const EndMotion& b) const { return axes.transpose() * turnRate(b.w - a.w); }
  // Loads of a force and a moment along the axes; `arm`: the line that the force turns about.
  SpringLoad loads(const Vec3& force, const Vec3& moment, const Vec3& arm) const {
    SpringLoad load;
    load.fb = axes * force;
    load.fa = -load.fb;
    const Vec3 couple = arm.cross(load.fb), bending = turnRate(axes * moment) + lean_ * couple.cross(turn);
    load.ta = 0.5 * couple + bending;
    load.tb = 0.5 * couple - bending;
    return load;
  }

  Vec3 line, turn, shift;
  Mat3 axes;

 private:
  double bend_, lean_;
};

SpringLoad beamLoad(const Spring& spring, const EndMotion& a, const EndMotion& b) {
  const Beam beam(spring, a, b);
  const Vec3 rate = beam.shiftRate(a, b), twist = beam.twist(), twistRate = beam.twistRate(a, b);
  const Vec3 elastic = spring.stiffness.cwiseProduct(beam.shift), viscous = spring.damping.cwiseProduct(rate);
  const Vec3 moment = spring.rotationalStiffness.cwiseProduct(twist);
  const Vec3 drag = spring.rotationalDamping.cwiseProduct(twistRate);
  SpringLoad load = beam.loads(elastic + viscous, moment + drag, beam.line);
  load.energy = 0.5 * (elastic.dot(beam.shift) + moment.dot(twist));
  load.dissipation = viscous.dot(rate) + drag.dot(twistRate);
  return load;
}

SpringLoad beamTangent(const Spring& spring, const EndMotion& a, const EndMotion& b, bool damping) {
  const Beam beam(spring, a, b);
  const Vec3 force = (damping ? spring.damping : spring.stiffness).cwiseProduct(beam.shiftRate(a, b));
  const Vec3 moment =
      (damping ? spring.rotationalDamping : spring.rotationalStiffness).cwiseProduct(beam.twistRate(a, b));
  return beam.loads(force, moment, beam.line);
}

SpringLoad beamLoadDerivative(const Spring& spring, const EndMotion& a, const EndMotion& b, const EndMotion& da,
                              const EndMotion& db) {
  const Beam beam(spring, a, b);
  const Vec3 dLine = da.x - db.x, dShift = beam.axes.transpose() * dLine;
  const Vec3 dRate = beam.shiftRate(da, db) - beam.axes.transpose() * beam.middleSpin(a.w, b.w).cross(dLine);
  const Vec3 elastic = spring.stiffness.cwiseProduct(beam.shift);
  const Vec3 force = elastic + spring.damping.cwiseProduct(beam.shiftRate(a, b));
  const Vec3 dForce = spring.stiffness.cwiseProduct(dShift) + spring.damping.cwiseProduct(dRate);
  const Vec3 dMoment = spring.rotationalDamping.cwiseProduct(beam.twistRate(da, db));
  SpringLoad change = beam.loads(dForce, dMoment, beam.line);
  const SpringLoad turned = beam.loads(force, Vec3::Zero(), dLine);  // the force itself, over the line's change
  change.ta += turned.ta;
  change.tb += turned.tb;
  change.energy = elastic.dot(dShift);
  return change;
}

}  // namespace

SpringLoad springLoad(const Spring& spring, const EndMotion& a, const EndMotion& b) {
  if (spring.kind == SpringKind::beam) return beamLoad(spring, a, b);
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
  if (spring.kind == SpringKind::beam) return beamTangent(spring, a, b, damping);
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
  if (spring.kind == SpringKind::beam) return beamLoadDerivative(spring, a, b, da, db);
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
