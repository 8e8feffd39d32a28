// Sine, cosine and angle from the four operations and the square root alone, which IEEE 754 rounds in one way. The C
// library's differ between systems, and glibc picks among several by processor: results would depend on the machine.
// Static, since the kernels are compiled once for each instruction set and must not share functions.
#pragma once

#include <cmath>

namespace tiefmu {

// first + x second + x^2 third ...
template <class... More> static inline double series(double x, double first, More... more) {
  if constexpr (sizeof...(more) == 0)
    return first;
  else
    return first + x * series(x, more...);
}

struct SineCosine { double sine, cosine; };

// Of `angle`, rad. Errors below 2.2e-16 up to 1e5 rad; beyond, below the rounding of the angle itself. NaN of what is
// not finite.
static inline SineCosine sineCosine(double angle) {
  constexpr double half = 1.5707963267948966;  // pi/2 to 53 bits, and in three parts, of which two have 33 bits
  constexpr double part1 = 0x1.921fb544p+0, part2 = 0x1.0b4611a6p-34, part3 = 0x1.3198a2e037073p-69;
  if (!(angle - angle == 0)) return {angle - angle, angle - angle};
  if (angle > 1e5 || angle < -1e5) angle = std::fmod(angle, 4 * half);  // exact
  const int quarter = static_cast<int>(angle / half + (angle < 0 ? -0.5 : 0.5));
  const double n = quarter;
  const double r = ((angle - n * part1) - n * part2) - n * part3;  // in [-pi/4, pi/4]; n part1 and n part2 are exact
  const double r2 = r * r;
  // Taylor series: the next terms are below 1e-18.
  const double sine = r + r * r2 *
                              series(r2, -1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800,
                                     1.0 / 6227020800, -1.0 / 1307674368000, 1.0 / 355687428096000);
  const double cosine = 1 - r2 * series(r2, 0.5, -1.0 / 24, 1.0 / 720, -1.0 / 40320, 1.0 / 3628800, -1.0 / 479001600,
                                        1.0 / 87178291200, -1.0 / 20922789888000);
  switch (quarter & 3) {
    case 0: return {sine, cosine};
    case 1: return {cosine, -sine};
    case 2: return {-sine, -cosine};
    default: return {-cosine, sine};
  }
}

// Angle of the point (x, y), both not negative and not both 0, in [0, pi/2] rad. Errors below 2.3e-16.
static inline double angleOf(double y, double x) {
  const double t = y > x ? x / y : y / x;
  if (!(t <= 1)) return t;  // NaN
  // atan t = atan c + atan((t - c)/(1 + t c)), c the nearest quarter
  static constexpr double quarters[] = {0, 0.24497866312686414, 0.4636476090008061, 0.6435011087932844,
                                        0.7853981633974483};
  const int k = static_cast<int>(4 * t + 0.5);
  const double c = 0.25 * k, u = (t - c) / (1 + t * c), u2 = u * u;  // |u| <= 1/8: the next term is below 1e-18
  const double rest =
      u + u * u2 * series(u2, -1.0 / 3, 1.0 / 5, -1.0 / 7, 1.0 / 9, -1.0 / 11, 1.0 / 13, -1.0 / 15, 1.0 / 17);
  const double angle = quarters[k] + rest;
  return y > x ? 1.5707963267948966 - angle : angle;
}

}  // namespace tiefmu
