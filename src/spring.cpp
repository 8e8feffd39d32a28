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
  // What a couple adds to the bending, as it turns the axes.
  Vec3 lean(const Vec3& couple) const { return lean_ * couple.cross(turn); }
  // Loads of a force and a moment along the axes; `arm`: the line that the force turns about.
  SpringLoad loads(const Vec3& force, const Vec3& moment, const Vec3& arm) const {
    SpringLoad load;
    load.fb = axes * force;
    load.fa = -load.fb;
    const Vec3 couple = arm.cross(load.fb), bending = turnRate(axes * moment) + lean(couple);
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

// Its columns are what f makes of the unit vectors.
template <class F> Mat3 matrixOf(F f) {
  Mat3 m;
  for (int k = 0; k < 3; ++k) m.col(k) = f(Vec3::Unit(k));
  return m;
}

// Where the blocks of a SpringJacobian begin.
namespace row {
enum : int { fb = 0, ta = 3, tb = 6 };
}
namespace column {
enum : int { line = 0, gap = 3, wa = 6, wb = 9 };
}
using LoadRow = Eigen::Matrix<double, 3, 12>;

SpringJacobian beamJacobian(const Spring& spring, const EndMotion& a, const EndMotion& b) {
  const Beam beam(spring, a, b);
  const Vec3 none = Vec3::Zero();
  const auto inAxes = [&](const Vec3& diagonal) -> Mat3 {
    return beam.axes * diagonal.asDiagonal() * beam.axes.transpose();
  };
  const Vec3 elastic = spring.stiffness.cwiseProduct(beam.shift);
  const Vec3 force = beam.axes * (elastic + spring.damping.cwiseProduct(beam.shiftRate(a, b)));
  const Mat3 damping = inAxes(spring.damping), arm = skew(beam.line);
  // F: the shift changes with the line, its rate with the line, the gap and the spin of the axes.
  LoadRow dForce;
  dForce.middleCols<3>(column::line) = inAxes(spring.stiffness) - damping * skew(beam.middleSpin(a.w, b.w));
  dForce.middleCols<3>(column::gap) = damping;
  dForce.middleCols<3>(column::wa) = damping * arm * matrixOf([&](const Vec3& w) { return beam.middleSpin(w, none); });
  dForce.middleCols<3>(column::wb) = damping * arm * matrixOf([&](const Vec3& w) { return beam.middleSpin(none, w); });
  // C = line x F and N = S M + lean C x theta, in which M changes with the spins.
  LoadRow dCouple = arm * dForce;
  dCouple.middleCols<3>(column::line) -= skew(force);
  LoadRow dBending = matrixOf([&](const Vec3& couple) { return beam.lean(couple); }) * dCouple;
  const Mat3 rate = matrixOf([&](const Vec3& spin) { return beam.turnRate(spin); });
  const Mat3 twisting = rate * inAxes(spring.rotationalDamping) * rate;
  dBending.middleCols<3>(column::wa) -= twisting;
  dBending.middleCols<3>(column::wb) += twisting;
  SpringJacobian j;
  j.loads << dForce, 0.5 * dCouple + dBending, 0.5 * dCouple - dBending;
  j.energy = beam.axes * elastic;
  return j;
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

SpringJacobian springJacobian(const Spring& spring, const EndMotion& a, const EndMotion& b) {
  if (spring.kind == SpringKind::beam) return beamJacobian(spring, a, b);
  SpringJacobian j;
  const Vec3 across = a.x - b.x;
  if (spring.kind == SpringKind::axial) {
    const double length = across.norm();
    if (!(length > 0)) return j;
    const Vec3 n = across / length, speed = a.v - b.v;
    const Mat3 turn = (Mat3::Identity() - n * n.transpose()) / length;  // dn = turn dLine
    const double k = spring.stiffness[0], c = spring.damping[0], elongation = length - spring.length;
    const double tension = k * elongation + c * n.dot(speed);
    j.loads.block<3, 3>(row::fb, column::line) = n * (k * n + c * (turn * speed)).transpose() + tension * turn;
    j.loads.block<3, 3>(row::fb, column::gap) = c * n * n.transpose();
    j.energy = k * elongation * n;
    return j;
  }
  const Mat3 damping = spring.damping.asDiagonal(), twisting = spring.rotationalDamping.asDiagonal();
  const Mat3 arm = skew(across);
  j.loads.block<3, 3>(row::fb, column::line) = Mat3(spring.stiffness.asDiagonal()) - damping * skew(b.w);
  j.loads.block<3, 3>(row::fb, column::gap) = damping;
  j.loads.block<3, 3>(row::fb, column::wb) = damping * arm;
  j.loads.block<3, 3>(row::ta, column::wa) = -twisting;
  j.loads.block<3, 3>(row::ta, column::wb) = twisting;
  j.loads.middleRows<3>(row::tb) = arm * j.loads.middleRows<3>(row::fb) - j.loads.middleRows<3>(row::ta);
  j.loads.block<3, 3>(row::tb, column::line) -= skew(springLoad(spring, a, b).fb);
  j.energy = spring.stiffness.cwiseProduct(across - b.q * spring.arm);
  return j;
}

}  // namespace tiefmu
