// A vector of three in SIMD registers, and four numbers side by side. Every operation rounds alike in each build, so
// that results do not depend on the machine.
#pragma once

#include <cstddef>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#define TIEFMU_INLINE inline __attribute__((always_inline))
#define TIEFMU_INLINED __attribute__((always_inline))  // for lambdas

namespace tiefmu {
namespace {  // the builds must not share functions

#ifdef __AVX2__
// One register; the fourth lane is never used.
struct SimdVec3 {
  __m256d v;
  TIEFMU_INLINE double operator[](int k) const { return v[k]; }
};
TIEFMU_INLINE SimdVec3 load(const double* p) { return {_mm256_maskload_pd(p, _mm256_set_epi64x(0, -1, -1, -1))}; }
// The same from where a `store` may still be on its way to memory, which forwards to loads of its own shape only.
TIEFMU_INLINE SimdVec3 loadStored(const double* p) {
  return {_mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(p)), _mm_load_sd(p + 2), 1)};
}
TIEFMU_INLINE SimdVec3 simdVec3(double x, double y, double z) { return {_mm256_setr_pd(x, y, z, z)}; }
TIEFMU_INLINE void store(double* p, SimdVec3 a) {  // masked stores are slow on some processors
  _mm_storeu_pd(p, _mm256_castpd256_pd128(a.v));
  _mm_store_sd(p + 2, _mm256_extractf128_pd(a.v, 1));
}
TIEFMU_INLINE SimdVec3 operator+(SimdVec3 a, SimdVec3 b) { return {a.v + b.v}; }
TIEFMU_INLINE SimdVec3 operator-(SimdVec3 a, SimdVec3 b) { return {a.v - b.v}; }
TIEFMU_INLINE SimdVec3 operator-(SimdVec3 a) { return {-a.v}; }
TIEFMU_INLINE SimdVec3 operator*(SimdVec3 a, SimdVec3 b) { return {a.v * b.v}; }
TIEFMU_INLINE SimdVec3 operator*(double s, SimdVec3 a) { return {_mm256_set1_pd(s) * a.v}; }
TIEFMU_INLINE SimdVec3 operator/(SimdVec3 a, double s) { return {a.v / _mm256_set1_pd(s)}; }
TIEFMU_INLINE SimdVec3 yzx(SimdVec3 a) { return {_mm256_permute4x64_pd(a.v, 0xC9)}; }
template <int K> TIEFMU_INLINE SimdVec3 lane(SimdVec3 a) {
  return {_mm256_permute4x64_pd(a.v, 0x55 * K)};
}  // (a_K, a_K, a_K)
#else
// x, y in one register and z in another, which baseline x86-64 (and every other 16-byte vector unit) serves.
using Simd2 = double __attribute__((vector_size(16)));
struct SimdVec3 {
  Simd2 xy;
  double z;
  TIEFMU_INLINE double operator[](int k) const { return k < 2 ? xy[k] : z; }
};
TIEFMU_INLINE SimdVec3 load(const double* p) { return {Simd2{p[0], p[1]}, p[2]}; }
TIEFMU_INLINE SimdVec3 loadStored(const double* p) { return load(p); }
TIEFMU_INLINE SimdVec3 simdVec3(double x, double y, double z) { return {Simd2{x, y}, z}; }
TIEFMU_INLINE void store(double* p, SimdVec3 a) {
  p[0] = a.xy[0];
  p[1] = a.xy[1];
  p[2] = a.z;
}
TIEFMU_INLINE SimdVec3 operator+(SimdVec3 a, SimdVec3 b) { return {a.xy + b.xy, a.z + b.z}; }
TIEFMU_INLINE SimdVec3 operator-(SimdVec3 a, SimdVec3 b) { return {a.xy - b.xy, a.z - b.z}; }
TIEFMU_INLINE SimdVec3 operator-(SimdVec3 a) { return {-a.xy, -a.z}; }
TIEFMU_INLINE SimdVec3 operator*(SimdVec3 a, SimdVec3 b) { return {a.xy * b.xy, a.z * b.z}; }
TIEFMU_INLINE SimdVec3 operator*(double s, SimdVec3 a) { return {s * a.xy, s * a.z}; }
TIEFMU_INLINE SimdVec3 operator/(SimdVec3 a, double s) { return {a.xy / s, a.z / s}; }
TIEFMU_INLINE SimdVec3 yzx(SimdVec3 a) { return {Simd2{a.xy[1], a.z}, a.xy[0]}; }
template <int K> TIEFMU_INLINE SimdVec3 lane(SimdVec3 a) { return {Simd2{a[K], a[K]}, a[K]}; }
#endif

TIEFMU_INLINE SimdVec3& operator+=(SimdVec3& a, SimdVec3 b) { return a = a + b; }
// z, x, y of a x b: sums of cross products are put in order once, by yzx.
TIEFMU_INLINE SimdVec3 crossZxy(SimdVec3 a, SimdVec3 b) { return a * yzx(b) - yzx(a) * b; }
TIEFMU_INLINE SimdVec3 cross(SimdVec3 a, SimdVec3 b) { return yzx(crossZxy(a, b)); }
TIEFMU_INLINE double dot(SimdVec3 a, SimdVec3 b) {
  const SimdVec3 p = a * b;
  return p[0] + p[1] + p[2];
}
struct SimdMat3 { SimdVec3 x, y, z; };
TIEFMU_INLINE SimdMat3 loadMat3(const double* m) { return {load(m), load(m + 3), load(m + 6)}; }
TIEFMU_INLINE SimdVec3 operator*(const SimdMat3& m, SimdVec3 a) {
  return m.x * lane<0>(a) + m.y * lane<1>(a) + m.z * lane<2>(a);
}

// The same number of four neighbours, side by side.
using Simd4 = double __attribute__((vector_size(32)));
template <class Number> struct Vec3Of { Number x, y, z; };
using Simd4Vec3 = Vec3Of<Simd4>;
#ifdef __AVX2__
TIEFMU_INLINE Simd4 root(Simd4 a) { return _mm256_sqrt_pd(a); }
// Four vectors of three, one a lane.
TIEFMU_INLINE Simd4Vec3 loadFour(const double* p, const double* q, const double* r, const double* s) {
  const __m256d a = load(p).v, b = load(q).v, c = load(r).v, d = load(s).v;
  const __m256d xz0 = _mm256_unpacklo_pd(a, b), xz1 = _mm256_unpacklo_pd(c, d);
  const __m256d y0 = _mm256_unpackhi_pd(a, b), y1 = _mm256_unpackhi_pd(c, d);
  return {_mm256_permute2f128_pd(xz0, xz1, 0x20), _mm256_permute2f128_pd(y0, y1, 0x20),
          _mm256_permute2f128_pd(xz0, xz1, 0x31)};
}
// The first `count` lanes of four numbers, to p, p + stride, ...
TIEFMU_INLINE void storeFour(double* p, std::ptrdiff_t stride, int count, Simd4 a, Simd4 b, Simd4 c, Simd4 d) {
  const __m256d p0 = _mm256_unpacklo_pd(a, b), p1 = _mm256_unpacklo_pd(c, d);
  const __m256d q0 = _mm256_unpackhi_pd(a, b), q1 = _mm256_unpackhi_pd(c, d);
  const __m256d row[4] = {_mm256_permute2f128_pd(p0, p1, 0x20), _mm256_permute2f128_pd(q0, q1, 0x20),
                          _mm256_permute2f128_pd(p0, p1, 0x31), _mm256_permute2f128_pd(q0, q1, 0x31)};
  for (int k = 0; k < count; ++k) _mm256_storeu_pd(p + k * stride, row[k]);
}
#else
TIEFMU_INLINE Simd4 root(Simd4 a) {
  return Simd4{__builtin_sqrt(a[0]), __builtin_sqrt(a[1]), __builtin_sqrt(a[2]), __builtin_sqrt(a[3])};
}
TIEFMU_INLINE Simd4Vec3 loadFour(const double* p, const double* q, const double* r, const double* s) {
  return {Simd4{p[0], q[0], r[0], s[0]}, Simd4{p[1], q[1], r[1], s[1]}, Simd4{p[2], q[2], r[2], s[2]}};
}
TIEFMU_INLINE void storeFour(double* p, std::ptrdiff_t stride, int count, Simd4 a, Simd4 b, Simd4 c, Simd4 d) {
  for (int k = 0; k < count; ++k) {
    p[k * stride] = a[k];
    p[k * stride + 1] = b[k];
    p[k * stride + 2] = c[k];
    p[k * stride + 3] = d[k];
  }
}
#endif
template <class N> TIEFMU_INLINE Vec3Of<N> operator+(const Vec3Of<N>& a, const Vec3Of<N>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class N> TIEFMU_INLINE Vec3Of<N> operator-(const Vec3Of<N>& a, const Vec3Of<N>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class S, class N> TIEFMU_INLINE Vec3Of<N> operator*(const S& s, const Vec3Of<N>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class N> TIEFMU_INLINE Vec3Of<N> cross(const Vec3Of<N>& a, const Vec3Of<N>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class N> TIEFMU_INLINE N dot(const Vec3Of<N>& a, const Vec3Of<N>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

}  // namespace
}  // namespace tiefmu
