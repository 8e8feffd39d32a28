// The geometry of the tie and how it moves: frames of meanMotion segments, their rotations, offsets.
#pragma once

#include <cmath>

#include "elementary.hpp"
#include "tie_loops.ipp"

namespace tiefmu {
namespace {

// Symmetric matrices of four segments side by side: each is a long chain of dependent operations.
struct Simd4SymMat3 {
  Simd4 xx, xy, xz, yy, yz, zz;
  TIEFMU_INLINE Simd4Vec3 operator*(const Simd4Vec3& a) const {
    return {xx * a.x + xy * a.y + xz * a.z, xy * a.x + yy * a.y + yz * a.z, xz * a.x + yz * a.y + zz * a.z};
  }
};

// Arms from the centre of the nodes, and Ibar^-1.
template <int N> TIEFMU_INLINE Simd4SymMat3 frameOf(Simd4Vec3* x, Simd4Vec3& centre) {
  centre = x[0];
  for (int i = 1; i < N; ++i) centre = centre + x[i];
  centre = (1.0 / N) * centre;
  Simd4 xx = {}, xy = {}, xz = {}, yy = {}, yz = {}, zz = {};
  for (int i = 0; i < N; ++i) {
    x[i] = x[i] - centre;
    xx += x[i].x * x[i].x;
    xy += x[i].x * x[i].y;
    xz += x[i].x * x[i].z;
    yy += x[i].y * x[i].y;
    yz += x[i].y * x[i].z;
    zz += x[i].z * x[i].z;
  }
  const Simd4 a = yy + zz, b = -xy, c = -xz, d = xx + zz, e = -yz, f = xx + yy;
  const Simd4 A = d * f - e * e, B = c * e - b * f, C = b * e - c * d;
  const Simd4 s = 1.0 / (a * A + b * B + c * C);
  return {s * A, s * B, s * C, s * (a * f - c * c), s * (b * c - a * e), s * (a * d - b * b)};
}

template <int N>
TIEFMU_INLINE void storeFrames(const Simd4Vec3* arm, const Simd4Vec3& centre, const Simd4SymMat3& inverse,
                               SegmentFrame* frame, int count) {
  constexpr std::ptrdiff_t stride = sizeof(SegmentFrame) / sizeof(double);
  static_assert(offsetof(SegmentFrame, centre) == 12 * sizeof(double) && stride == 24);
  double* to = frame->arm;
  const Simd4Vec3 last = N == 4 ? arm[3] : Simd4Vec3{};
  storeFour(to, stride, count, arm[0].x, arm[0].y, arm[0].z, arm[1].x);
  storeFour(to + 4, stride, count, arm[1].y, arm[1].z, arm[2].x, arm[2].y);
  storeFour(to + 8, stride, count, arm[2].z, last.x, last.y, last.z);
  storeFour(to + 12, stride, count, centre.x, centre.y, centre.z, inverse.xx);
  storeFour(to + 16, stride, count, inverse.xy, inverse.xz, inverse.xy, inverse.yy);
  storeFour(to + 20, stride, count, inverse.yz, inverse.xz, inverse.yz, inverse.zz);
}

// Of sums of x - x, which is 0 only where x is finite.
TIEFMU_INLINE bool allFinite(const Simd4& sum) { return sum[0] + sum[1] + sum[2] + sum[3] == 0; }

// Calls body(first segment, how many of the four count, gather); past the end the last segment stands in.
template <int N, class Body> TIEFMU_INLINE void eachFourSegments(const TieView& tie, int first, int end, Body body) {
  for (int e = first; e < end; e += 4) {
    const int last = end - 1, count = last - e < 3 ? last - e + 1 : 4;
    const int* node[4];
    for (int k = 0; k < 4; ++k) node[k] = tie.node + N * static_cast<std::ptrdiff_t>(e + k < last ? e + k : last);
    const auto gather = [&](const double* field, Simd4Vec3* to) TIEFMU_INLINED {
      const auto at = [&](int k, int i) TIEFMU_INLINED { return field + 3 * static_cast<std::ptrdiff_t>(node[k][i]); };
      for (int i = 0; i < N; ++i) to[i] = loadFour(at(0, i), at(1, i), at(2, i), at(3, i));
    };
    if (count == 4)
      body(e, 4, gather);
    else
      body(e, count, gather);
  }
}

bool updateFrames(const TieView& tie, const double* position, SegmentFrame* frame) {
  Simd4 nonFinite = {};
  byCorners(tie, [&](auto n) TIEFMU_INLINED {
    constexpr int N = decltype(n)::value;
    eachFourSegments<N>(tie, tie.range.first, tie.range.last, [&](int e, int count, auto gather) TIEFMU_INLINED {
      Simd4Vec3 x[N], centre;
      gather(position, x);
      const Simd4SymMat3 inverse = frameOf<N>(x, centre);
      storeFrames<N>(x, centre, inverse, frame + e, count);
      nonFinite += inverse.xx - inverse.xx;
    });
  });
  return allFinite(nonFinite);
}

// sin(a)/a and (1 - cos a)/a^2 of steps above 2 degrees.
TIEFMU_INLINE void large(double a2, double& s, double& c) {
  if (!(a2 >= 1e-3)) return;
  const double a = std::sqrt(a2);
  const SineCosine half = sineCosine(0.5 * a);
  s = 2 * half.sine * half.cosine / a;
  c = 2 * half.sine * half.sine / a2;
}
TIEFMU_INLINE void large(const Simd4& a2, Simd4& s, Simd4& c) {
  if (!((a2[0] >= 1e-3) | (a2[1] >= 1e-3) | (a2[2] >= 1e-3) | (a2[3] >= 1e-3))) return;
  for (int k = 0; k < 4; ++k) {
    double sk = s[k], ck = c[k];
    large(a2[k], sk, ck);
    s[k] = sk;
    c[k] = ck;
  }
}

// d + sin(a)/a (angle x d) + (1 - cos a)/a^2 angle x (angle x d), a = |angle| [Rodrigues 1840], at its length, of which
// `inverse` is 1/square.
template <class N> TIEFMU_INLINE Vec3Of<N> turned(const Vec3Of<N>& angle, const Vec3Of<N>& d, const N& inverse) {
  const N a2 = dot(angle, angle);
  // The terms left out are below 1e-17.
  N s = 1 + a2 * (-1.0 / 6 + a2 * (1.0 / 120 - a2 * (1.0 / 5040)));
  N c = 0.5 + a2 * (-1.0 / 24 + a2 * (1.0 / 720 - a2 * (1.0 / 40320)));
  large(a2, s, c);
  const Vec3Of<N> once = cross(angle, d), next = d + s * once + c * cross(angle, once);
  // One Newton step of 1/sqrt: exact, as the length is off by rounding only.
  const N scale = 1.5 - 0.5 * dot(next, next) * inverse;
  return scale * next;
}

void turnOffsets(const TieView& tie, double h, const double* spin, const double* inverseLength2, double* offset) {
  constexpr int most = 128;
  double angle[3 * most];  // of the slaves [first, first + count)
  std::ptrdiff_t first = tie.firstSlave + tie.begin[tie.range.first];
  int count = 0;
  const auto turn = [&](int fours) TIEFMU_INLINED {
    for (int k = 0; k < fours; k += 4) {
      const double* u = angle + 3 * k;
      double* d = offset + 3 * (first + k);
      const double* i = inverseLength2 + first + k;
      const Simd4 inverse = {i[0], i[1], i[2], i[3]};
      const Simd4Vec3 next = turned(loadFour(u, u + 3, u + 6, u + 9), loadFour(d, d + 3, d + 6, d + 9), inverse);
      for (int m = 0; m < 4; ++m) {
        d[3 * m] = next.x[m];
        d[3 * m + 1] = next.y[m];
        d[3 * m + 2] = next.z[m];
      }
    }
    first += fours;
  };
  byCorners(tie, [&](auto n) TIEFMU_INLINED {
    constexpr int N = decltype(n)::value;
    const double* weight = weights<N>(tie);
    eachSegment<N>(tie, [&](int, Corners<N> nodes, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
      SimdVec3 wi[N];
      nodes.gather(spin, wi);
      for (int i = 0; i < N; ++i) wi[i] = h * wi[i];
      while (s < last) {
        const std::ptrdiff_t end = last - s < most - count ? last : s + (most - count);
        for (; s < end; ++s, ++count) store(angle + 3 * count, weighted<N>(weight + N * s, wi));
        if (count == most) {
          turn(most);
          count = 0;
        }
      }
    });
  });
  const int fours = count - count % 4;
  turn(fours);
  for (int k = fours; k < count; ++k) {
    const double* u = angle + 3 * k;
    double* d = offset + 3 * (first + k - fours);
    const Vec3Of<double> next =
        turned(Vec3Of<double>{u[0], u[1], u[2]}, Vec3Of<double>{d[0], d[1], d[2]}, inverseLength2[first + k - fours]);
    d[0] = next.x;
    d[1] = next.y;
    d[2] = next.z;
  }
}

// q <- (1, u) q, scaled to unit length, for the first `count` of four quaternions.
TIEFMU_INLINE void turnQuaternions(const Simd4Vec3& u, int count, double* q) {
  const auto old = [&](int m) TIEFMU_INLINED {
    const auto of = [&](int k) TIEFMU_INLINED { return q[4 * (k < count ? k : count - 1) + m]; };
    return Simd4{of(0), of(1), of(2), of(3)};
  };
  const Simd4 a = old(0), b = old(1), c = old(2), d = old(3);
  const Simd4 w = a - u.x * b - u.y * c - u.z * d, i = b + u.x * a + u.y * d - u.z * c,
              j = c + u.y * a + u.z * b - u.x * d, k = d + u.z * a + u.x * c - u.y * b;
  const Simd4 scale = 1.0 / root(w * w + i * i + j * j + k * k);
  storeFour(q, 4, count, scale * w, scale * i, scale * j, scale * k);
}

bool moveSegments(const TieView& tie, double h, const double* position, const double* velocity, SegmentFrame* frame,
                  double* rotation) {
  Simd4 nonFinite = {};
  eachRun(tie, [&](int first, int last) TIEFMU_INLINED {
    Simd4Vec3 turn[together / 4];
    byCorners(tie, [&](auto n) TIEFMU_INLINED {
      constexpr int N = decltype(n)::value;
      eachFourSegments<N>(tie, first, last, [&](int e, int count, auto gather) TIEFMU_INLINED {
        Simd4Vec3 x[N], v[N], r[N], centre;
        gather(position, x);
        gather(velocity, v);
        if (rotation) {
          for (int i = 0; i < N; ++i) r[i] = x[i] + (0.5 * h) * v[i];
          const Simd4SymMat3 inverse = frameOf<N>(r, centre);
          Simd4Vec3 sum = cross(r[0], v[0]);
          for (int i = 1; i < N; ++i) sum = sum + cross(r[i], v[i]);
          const Simd4Vec3 u = (0.5 * h) * (inverse * sum);
          nonFinite += u.x - u.x;
          turn[(e - first) / 4] = u;
        }
        // The end as the positions are advanced, so that a restored state finds the same bits.
        for (int i = 0; i < N; ++i) x[i] = x[i] + h * v[i];
        const Simd4SymMat3 inverse = frameOf<N>(x, centre);
        storeFrames<N>(x, centre, inverse, frame + e, count);
        nonFinite += inverse.xx - inverse.xx;
      });
    });
    if (!rotation) return;
    for (int e = first; e + 4 <= last; e += 4)
      turnQuaternions(turn[(e - first) / 4], 4, rotation + 4 * static_cast<std::ptrdiff_t>(e));
    const int left = (last - first) % 4;
    if (left > 0)
      turnQuaternions(turn[(last - first) / 4], left, rotation + 4 * static_cast<std::ptrdiff_t>(last - left));
  });
  return allFinite(nonFinite);
}

void rotateOffsets(const TieView& tie, const double* rotation, const double* initialOffset, double* offset) {
  for (int e = tie.range.first; e < tie.range.last; ++e) {
    const double* q = rotation + 4 * static_cast<std::ptrdiff_t>(e);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const SimdVec3 c0 = simdVec3(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y));
    const SimdVec3 c1 = simdVec3(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x));
    const SimdVec3 c2 = simdVec3(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y));
    for (std::ptrdiff_t s = tie.firstSlave + tie.begin[e]; s < tie.firstSlave + tie.begin[e + 1]; ++s) {
      const double* d0 = initialOffset + 3 * s;
      prefetch(d0);
      prefetchToWrite(offset + 3 * s);
      store(offset + 3 * s, d0[0] * c0 + d0[1] * c1 + d0[2] * c2);
    }
  }
}

void meanSpin(const TieView& tie, const SegmentFrame* frame, const double* velocity, double* spin) {
  byCorners(tie, [&](auto n) TIEFMU_INLINED {
    constexpr int N = decltype(n)::value;
    eachSegment<N>(tie, [&](int e, Corners<N> nodes, std::ptrdiff_t, std::ptrdiff_t) TIEFMU_INLINED {
      SimdVec3 v[N], r[N];
      nodes.gather(velocity, v);
      arms<N>(frame[e], r);
      store(spin + 3 * static_cast<std::ptrdiff_t>(e), loadMat3(frame[e].inverse) * angularMomentum<N>(r, v));
    });
  });
}

}  // namespace
}  // namespace tiefmu
