// What the kernels of segment_solve.ipp and surface_solve.ipp compute with: four segments (nodes) side by side.
#pragma once

#include <cstddef>

#include "segment_solve.hpp"
#include "simd.hpp"

namespace tiefmu {
namespace {

TIEFMU_INLINE Simd4 lanes(const double* p) {
  Simd4 l;
  __builtin_memcpy(&l, p, sizeof l);
  return l;
}

TIEFMU_INLINE double largest(Simd4 l) {
  const double a = l[0] > l[1] ? l[0] : l[1], b = l[2] > l[3] ? l[2] : l[3];
  return a > b ? a : b;
}

// Four vectors, one a lane, to where each belongs.
TIEFMU_INLINE void storeFour(const Simd4Vec3& v, double* p, double* q, double* r, double* s) {
#ifdef __AVX2__
  const __m256d even = _mm256_unpacklo_pd(v.x, v.y), odd = _mm256_unpackhi_pd(v.x, v.y);
  const __m128d low = _mm256_castpd256_pd128(v.z), high = _mm256_extractf128_pd(v.z, 1);
  _mm_storeu_pd(p, _mm256_castpd256_pd128(even));
  _mm_storel_pd(p + 2, low);
  _mm_storeu_pd(q, _mm256_castpd256_pd128(odd));
  _mm_storeh_pd(q + 2, low);
  _mm_storeu_pd(r, _mm256_extractf128_pd(even, 1));
  _mm_storel_pd(r + 2, high);
  _mm_storeu_pd(s, _mm256_extractf128_pd(odd, 1));
  _mm_storeh_pd(s + 2, high);
#else
  double* const to[4] = {p, q, r, s};
  for (int k = 0; k < 4; ++k) {
    to[k][0] = v.x[k];
    to[k][1] = v.y[k];
    to[k][2] = v.z[k];
  }
#endif
}

// Adds four vectors, one a lane, one after the other: places may be the same.
TIEFMU_INLINE void addFour(const Simd4Vec3& v, double* p, double* q, double* r, double* s) {
#ifdef __AVX2__
  const __m256d even = _mm256_unpacklo_pd(v.x, v.y), odd = _mm256_unpackhi_pd(v.x, v.y);
  const __m256d evenZ = _mm256_unpacklo_pd(v.z, v.z), oddZ = _mm256_unpackhi_pd(v.z, v.z);
  store(p, loadStored(p) + SimdVec3{_mm256_permute2f128_pd(even, evenZ, 0x20)});
  store(q, loadStored(q) + SimdVec3{_mm256_permute2f128_pd(odd, oddZ, 0x20)});
  store(r, loadStored(r) + SimdVec3{_mm256_permute2f128_pd(even, evenZ, 0x31)});
  store(s, loadStored(s) + SimdVec3{_mm256_permute2f128_pd(odd, oddZ, 0x31)});
#else
  double* const to[4] = {p, q, r, s};
  for (int k = 0; k < 4; ++k) {
    to[k][0] += v.x[k];
    to[k][1] += v.y[k];
    to[k][2] += v.z[k];
  }
#endif
}

// The same number of N neighbours in each of four places: to[i][k] = at[k][i].
template <int N> TIEFMU_INLINE void transposed(const double* const* at, Simd4* to) {
#ifdef __AVX2__
  if constexpr (N == 4) {
    const __m256d a = _mm256_loadu_pd(at[0]), b = _mm256_loadu_pd(at[1]), c = _mm256_loadu_pd(at[2]),
                  d = _mm256_loadu_pd(at[3]);
    const __m256d ab0 = _mm256_unpacklo_pd(a, b), ab1 = _mm256_unpackhi_pd(a, b);
    const __m256d cd0 = _mm256_unpacklo_pd(c, d), cd1 = _mm256_unpackhi_pd(c, d);
    to[0] = _mm256_permute2f128_pd(ab0, cd0, 0x20);
    to[1] = _mm256_permute2f128_pd(ab1, cd1, 0x20);
    to[2] = _mm256_permute2f128_pd(ab0, cd0, 0x31);
    to[3] = _mm256_permute2f128_pd(ab1, cd1, 0x31);
    return;
  }
#endif
  for (int i = 0; i < N; ++i) to[i] = Simd4{at[0][i], at[1][i], at[2][i], at[3][i]};
}

TIEFMU_INLINE Simd4Vec3& operator+=(Simd4Vec3& a, const Simd4Vec3& b) { return a = a + b; }
TIEFMU_INLINE Simd4Vec3& operator-=(Simd4Vec3& a, const Simd4Vec3& b) { return a = a - b; }

struct Symmetric { Simd4 xx, xy, xz, yy, yz, zz; };
TIEFMU_INLINE Simd4Vec3 operator*(const Symmetric& m, const Simd4Vec3& a) {
  return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.xy * a.x + m.yy * a.y + m.yz * a.z,
          m.xz * a.x + m.yz * a.y + m.zz * a.z};
}
TIEFMU_INLINE Symmetric inverse(const Symmetric& m) {
  const Simd4 a = m.yy * m.zz - m.yz * m.yz, b = m.xz * m.yz - m.xy * m.zz, c = m.xy * m.yz - m.xz * m.yy;
  const Simd4 s = 1.0 / (m.xx * a + m.xy * b + m.xz * c);
  return {s * a,
          s * b,
          s * c,
          s * (m.xx * m.zz - m.xz * m.xz),
          s * (m.xy * m.xz - m.xx * m.yz),
          s * (m.xx * m.yy - m.xy * m.xy)};
}
// a 3x3 matrix by columns
struct Matrix { Simd4Vec3 x, y, z; };
TIEFMU_INLINE Simd4Vec3 operator*(const Matrix& m, const Simd4Vec3& a) { return a.x * m.x + a.y * m.y + a.z * m.z; }
TIEFMU_INLINE Simd4Vec3 transposedTimes(const Matrix& m, const Simd4Vec3& a) {
  return {dot(m.x, a), dot(m.y, a), dot(m.z, a)};
}
TIEFMU_INLINE Matrix operator*(const Symmetric& a, const Symmetric& b) {
  return {a * Simd4Vec3{b.xx, b.xy, b.xz}, a * Simd4Vec3{b.xy, b.yy, b.yz}, a * Simd4Vec3{b.xz, b.yz, b.zz}};
}
TIEFMU_INLINE Matrix operator*(const Matrix& a, const Symmetric& b) {
  return {a * Simd4Vec3{b.xx, b.xy, b.xz}, a * Simd4Vec3{b.xy, b.yy, b.yz}, a * Simd4Vec3{b.xz, b.yz, b.zz}};
}
// A B^T where that is symmetric.
TIEFMU_INLINE Symmetric timesTransposed(const Matrix& a, const Matrix& b) {
  return {a.x.x * b.x.x + a.y.x * b.y.x + a.z.x * b.z.x, a.x.x * b.x.y + a.y.x * b.y.y + a.z.x * b.z.y,
          a.x.x * b.x.z + a.y.x * b.y.z + a.z.x * b.z.z, a.x.y * b.x.y + a.y.y * b.y.y + a.z.y * b.z.y,
          a.x.y * b.x.z + a.y.y * b.y.z + a.z.y * b.z.z, a.x.z * b.x.z + a.y.z * b.y.z + a.z.z * b.z.z};
}
// sum of weight (r^2 1 - r r^T)
TIEFMU_INLINE void addInertia(const Simd4& weight, const Simd4Vec3& r, Symmetric& to) {
  const Simd4Vec3 w = weight * r;
  const Simd4 xx = w.x * r.x, yy = w.y * r.y, zz = w.z * r.z;
  to.xx += yy + zz;
  to.yy += xx + zz;
  to.zz += xx + yy;
  to.xy -= w.x * r.y;
  to.xz -= w.x * r.z;
  to.yz -= w.y * r.z;
}

// A body's first and second moments turned by unit quaternions.
TIEFMU_INLINE void turnBody(const double* const* rotation, Simd4Vec3& S, Symmetric& J) {
  Simd4 q[4];
  transposed<4>(rotation, q);
  const Matrix turn = {
      {1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]), 2.0 * (q[1] * q[2] + q[0] * q[3]), 2.0 * (q[1] * q[3] - q[0] * q[2])},
      {2.0 * (q[1] * q[2] - q[0] * q[3]), 1.0 - 2.0 * (q[1] * q[1] + q[3] * q[3]), 2.0 * (q[2] * q[3] + q[0] * q[1])},
      {2.0 * (q[1] * q[3] + q[0] * q[2]), 2.0 * (q[2] * q[3] - q[0] * q[1]), 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])}};
  S = turn * S;
  J = timesTransposed(turn * J, turn);
}

// Four segments of a list: where their numbers stand.
template <int N, bool mixed> struct Four {
  int segment[4];
  const int* node[4];
  const double* planes;
  int freeBegin, freeEnd;

  TIEFMU_INLINE Four(const TieView& tie, const SegmentList& list, int first, int count)
      : planes(list.planes + static_cast<std::ptrdiff_t>(first) * count),
        freeBegin(list.freeBegin),
        freeEnd(list.freeEnd) {
    for (int k = 0; k < 4; ++k) {
      segment[k] = list.segment[first + k];
      node[k] = tie.node + N * static_cast<std::ptrdiff_t>(segment[k]);
    }
  }
  TIEFMU_INLINE Simd4 plane(int k) const { return lanes(planes + 4 * k); }
  TIEFMU_INLINE Simd4Vec3 plane3(int k) const { return {plane(k), plane(k + 1), plane(k + 2)}; }
  TIEFMU_INLINE Simd4Vec3 gather(const double* field, int corner) const {
    const auto at = [&](int k) TIEFMU_INLINED { return field + 3 * static_cast<std::ptrdiff_t>(node[k][corner]); };
    return loadFour(at(0), at(1), at(2), at(3));
  }
  TIEFMU_INLINE void scatter(const Simd4Vec3& value, double* field, int corner) const {
    const auto at = [&](int k) TIEFMU_INLINED { return field + 3 * static_cast<std::ptrdiff_t>(node[k][corner]); };
    if constexpr (!mixed) {
      storeFour(value, at(0), at(1), at(2), at(3));
    } else {
      for (int k = 0; k < 4; ++k) {
        if (node[k][corner] < freeBegin || node[k][corner] >= freeEnd) continue;
        double* p = at(k);
        p[0] = value.x[k];
        p[1] = value.y[k];
        p[2] = value.z[k];
      }
    }
  }
  // Acceleration that a corner has without slaves: inverse mass times load, or what it is where it is not free.
  TIEFMU_INLINE Simd4Vec3 alone(const double* load, const double* acceleration, bool known, const Simd4& inverseMass,
                                int corner) const {
    const Simd4Vec3 own = inverseMass * gather(load, corner);
    if constexpr (!mixed) return own;
    return held(known, inverseMass == 0, acceleration, corner, own);
  }
  // The acceleration of a corner where `fixed`, else something else.
  template <class Mask>
  TIEFMU_INLINE Simd4Vec3 held(bool known, Mask fixed, const double* acceleration, int corner,
                               const Simd4Vec3& other) const {
    Simd4Vec3 a = {};
    if (known) a = gather(acceleration, corner);
    return {fixed ? a.x : other.x, fixed ? a.y : other.y, fixed ? a.z : other.z};
  }
  TIEFMU_INLINE Simd4 isFixed(int corner) const {
    const auto of = [&](int k) TIEFMU_INLINED {
      return node[k][corner] < freeBegin || node[k][corner] >= freeEnd ? 1.0 : 0.0;
    };
    return Simd4{of(0), of(1), of(2), of(3)};
  }
};

// The slaves of four segments, one of each at a time. Segments that have no more repeat their last one, with weight 0.
struct Slaves {
  std::ptrdiff_t first[4];
  int count[4], most = 0;
  template <class F> TIEFMU_INLINE Slaves(const TieView& tie, const F& four) {
    for (int k = 0; k < 4; ++k) {
      const int e = four.segment[k];
      first[k] = tie.firstSlave + tie.begin[e];
      count[k] = tie.begin[e + 1] - tie.begin[e];
      most = count[k] > most ? count[k] : most;
    }
  }
  TIEFMU_INLINE std::ptrdiff_t at(int lane, int slave) const {
    return first[lane] + (slave < count[lane] ? slave : count[lane] - 1);
  }
  TIEFMU_INLINE Simd4Vec3 load3(const double* field, int slave) const {
    return loadFour(field + 3 * at(0, slave), field + 3 * at(1, slave), field + 3 * at(2, slave),
                    field + 3 * at(3, slave));
  }
  TIEFMU_INLINE Simd4 load1(const double* field, int slave) const {
    return Simd4{field[at(0, slave)], field[at(1, slave)], field[at(2, slave)], field[at(3, slave)]};
  }
  TIEFMU_INLINE bool all(int slave) const {
    return (slave < count[0]) & (slave < count[1]) & (slave < count[2]) & (slave < count[3]);
  }
  // 1 where there is such a slave, 0 where there is none
  TIEFMU_INLINE Simd4 there(int slave) const {
    return Simd4{slave < count[0] ? 1.0 : 0.0, slave < count[1] ? 1.0 : 0.0, slave < count[2] ? 1.0 : 0.0,
                 slave < count[3] ? 1.0 : 0.0};
  }
};

}  // namespace
}  // namespace tiefmu
