// What the kernels of the tie share: loops over segments and their slaves, and small sums over a segment's corners.
#pragma once

#include <cstddef>
#include <type_traits>

#include "simd.hpp"
#include "tie_view.hpp"

namespace tiefmu {
namespace {

// Where a stream of slaves is read or written next: the processor's own guesses lose streams that stop and go.
constexpr std::ptrdiff_t prefetchDistance = 96;  // doubles
TIEFMU_INLINE void prefetch(const double* p) { __builtin_prefetch(p + prefetchDistance); }
TIEFMU_INLINE void prefetchToWrite(const double* p) { __builtin_prefetch(p + prefetchDistance, 1); }
TIEFMU_INLINE void prefetchFrame(const SegmentFrame* frame) {
  const double* p = frame[16].arm;
  __builtin_prefetch(p);
  __builtin_prefetch(p + 8);
  __builtin_prefetch(p + 16);
}

template <int N> struct Corners {
  const int* node;
  TIEFMU_INLINE void gather(const double* field, SimdVec3* to) const {
    for (int i = 0; i < N; ++i) to[i] = load(field + 3 * static_cast<std::ptrdiff_t>(node[i]));
  }
  TIEFMU_INLINE void add(const SimdVec3* from, double* field) const {
    for (int i = 0; i < N; ++i) {
      double* p = field + 3 * static_cast<std::ptrdiff_t>(node[i]);
      store(p, loadStored(p) + from[i]);
    }
  }
};

template <int N> TIEFMU_INLINE SimdVec3 weighted(const double* phi, const SimdVec3* u) {
  SimdVec3 sum = phi[0] * u[0];
  for (int i = 1; i < N; ++i) sum += phi[i] * u[i];
  return sum;
}

template <int N> TIEFMU_INLINE SimdVec3 mean(const SimdVec3* u) {
  SimdVec3 sum = u[0];
  for (int i = 1; i < N; ++i) sum += u[i];
  return (1.0 / N) * sum;
}

template <int N> TIEFMU_INLINE void arms(const SegmentFrame& frame, SimdVec3* r) {
  for (int i = 0; i < N; ++i) r[i] = load(frame.arm + 3 * i);
}

// sum r x v, of unit masses at the corners: Ibar w
template <int N> TIEFMU_INLINE SimdVec3 angularMomentum(const SimdVec3* r, const SimdVec3* v) {
  SimdVec3 sum = crossZxy(r[0], v[0]);
  for (int i = 1; i < N; ++i) sum += crossZxy(r[i], v[i]);
  return yzx(sum);
}

// Segments that a loop takes at a time, where several short loops hide the latency that one long one shows.
constexpr int together = 32;

// Calls body(first, last) over the range.
template <class Body> TIEFMU_INLINE void eachRun(const TieView& tie, Body body) {
  for (int first = tie.range.first; first < tie.range.last; first += together)
    body(first, tie.range.last - first < together ? tie.range.last : first + together);
}

template <int N> TIEFMU_INLINE Corners<N> corners(const TieView& tie, int e) {
  return {tie.node + N * static_cast<std::ptrdiff_t>(e)};
}

// Calls body(segment, corners, first slave, last slave); slaves as indices of the slave arrays.
template <int N, class Body> TIEFMU_INLINE void eachSegment(const TieView& tie, Body body) {
  for (int e = tie.range.first; e < tie.range.last; ++e)
    body(e, corners<N>(tie, e), tie.firstSlave + tie.begin[e], tie.firstSlave + tie.begin[e + 1]);
}

// Phi, to be indexed by N times a slave's place in the slave arrays.
template <int N> TIEFMU_INLINE const double* weights(const TieView& tie) { return tie.weight - N * tie.firstSlave; }

// Calls body(number of corners as a type).
template <class Body> TIEFMU_INLINE void byCorners(const TieView& tie, Body body) {
  if (tie.corners == 4)
    body(std::integral_constant<int, 4>{});
  else
    body(std::integral_constant<int, 3>{});
}

}  // namespace
}  // namespace tiefmu
