// Motion mapping, load distribution, bias and places of slaves: per slave, at a given geometry.
#pragma once

#include "tie_loops.ipp"

namespace tiefmu {
namespace {

template <int N> TIEFMU_INLINE void mapTranslation(const TieView& tie, const double* u, double* us) {
  const double* weight = weights<N>(tie);
  eachSegment<N>(tie, [&](int, Corners<N> nodes, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    SimdVec3 ui[N];
    nodes.gather(u, ui);
    for (; s < last; ++s) {
      prefetch(weight + N * s);
      prefetchToWrite(us + 3 * s);
      store(us + 3 * s, weighted<N>(weight + N * s, ui));
    }
  });
}

template <int N>
TIEFMU_INLINE void mapRotation(const TieView& tie, const double* offset, const double* u, const double* turn,
                               double* us, double* turns) {
  const double* weight = weights<N>(tie);
  eachSegment<N>(tie, [&](int, Corners<N> nodes, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    SimdVec3 ui[N], wi[N];
    nodes.gather(u, ui);
    nodes.gather(turn, wi);
    for (; s < last; ++s) {
      prefetch(offset + 3 * s);
      prefetch(weight + N * s);
      prefetchToWrite(us + 3 * s);
      prefetchToWrite(turns + 3 * s);
      const SimdVec3 w = weighted<N>(weight + N * s, wi);
      store(us + 3 * s, weighted<N>(weight + N * s, ui) + cross(w, load(offset + 3 * s)));
      store(turns + 3 * s, w);
    }
  });
}

template <int N>
TIEFMU_INLINE void mapMeanMotion(const TieView& tie, TieGeometry geometry, const double* u, double* us, double* turns) {
  eachRun(tie, [&](int first, int last) TIEFMU_INLINED {
    SimdVec3 centre[together], w[together];
    for (int e = first; e < last; ++e) {
      prefetchFrame(geometry.frame + e);
      SimdVec3 ui[N], r[N];
      corners<N>(tie, e).gather(u, ui);
      arms<N>(geometry.frame[e], r);
      centre[e - first] = mean<N>(ui);
      w[e - first] = angularMomentum<N>(r, ui);
    }
    for (int e = first; e < last; ++e) w[e - first] = loadMat3(geometry.frame[e].inverse) * w[e - first];
    for (int e = first; e < last; ++e) {
      const SimdVec3 c = centre[e - first], spin = w[e - first];
      for (std::ptrdiff_t s = tie.firstSlave + tie.begin[e]; s < tie.firstSlave + tie.begin[e + 1]; ++s) {
        prefetch(geometry.offset + 3 * s);
        prefetchToWrite(us + 3 * s);
        prefetchToWrite(turns + 3 * s);
        store(us + 3 * s, c + cross(spin, load(geometry.offset + 3 * s)));
        store(turns + 3 * s, spin);
      }
    }
  });
}

void mapMotion(const TieView& tie, TieGeometry geometry, const double* u, const double* turn, double* us,
               double* turns) {
  byCorners(tie, [&](auto n) TIEFMU_INLINED {
    constexpr int N = decltype(n)::value;
    switch (tie.coupling) {
      case Coupling::rotation: return mapRotation<N>(tie, geometry.offset, u, turn, us, turns);
      case Coupling::meanMotion: return mapMeanMotion<N>(tie, geometry, u, us, turns);
      case Coupling::translation: return mapTranslation<N>(tie, u, us);
    }
  });
}

template <int N> TIEFMU_INLINE void distributeTranslation(const TieView& tie, const double* force, double* f) {
  const double* weight = weights<N>(tie);
  eachSegment<N>(tie, [&](int, Corners<N> nodes, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    SimdVec3 fi[N] = {};
    for (; s < last; ++s) {
      prefetch(force + 3 * s);
      prefetch(weight + N * s);
      const SimdVec3 F = load(force + 3 * s);
      for (int i = 0; i < N; ++i) fi[i] += weight[N * s + i] * F;
    }
    nodes.add(fi, f);
  });
}

template <int N>
TIEFMU_INLINE void distributeRotation(const TieView& tie, const double* offset, const double* force,
                                      const double* moment, double* f, double* t) {
  const double* weight = weights<N>(tie);
  const std::ptrdiff_t end = tie.firstSlave + tie.begin[tie.range.last];
  SimdVec3 F = {}, M = {};
  const auto next = [&](std::ptrdiff_t s) TIEFMU_INLINED {
    prefetch(force + 3 * s);
    prefetch(moment + 3 * s);
    prefetch(offset + 3 * s);
    prefetch(weight + N * s);
    F = load(force + 3 * s);
    M = load(moment + 3 * s) + cross(load(offset + 3 * s), F);
  };
  if (tie.range.first < tie.range.last) next(tie.firstSlave + tie.begin[tie.range.first]);
  eachSegment<N>(tie, [&](int, Corners<N> nodes, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    SimdVec3 fi[N] = {}, ti[N] = {};
    for (; s < last; ++s) {
      const SimdVec3 F0 = F, M0 = M;
      if (s + 1 < end) next(s + 1);  // ahead of its use, as its latency is longer than this loop's work
      for (int i = 0; i < N; ++i) {
        fi[i] += weight[N * s + i] * F0;
        ti[i] += weight[N * s + i] * M0;
      }
    }
    nodes.add(fi, f);
    nodes.add(ti, t);
  });
}

template <int N>
TIEFMU_INLINE void distributeMeanMotion(const TieView& tie, TieGeometry geometry, const double* force,
                                        const double* moment, double* f) {
  eachRun(tie, [&](int first, int last) TIEFMU_INLINED {
    SimdVec3 F[together], A[together];
    for (int e = first; e < last; ++e) {
      prefetchFrame(geometry.frame + e);
      SimdVec3 sum = {}, moments = {}, levers = {};
      for (std::ptrdiff_t s = tie.firstSlave + tie.begin[e]; s < tie.firstSlave + tie.begin[e + 1]; ++s) {
        const SimdVec3 one = load(force + 3 * s);
        prefetch(force + 3 * s);
        prefetch(moment + 3 * s);
        prefetch(geometry.offset + 3 * s);
        sum += one;
        moments += load(moment + 3 * s);
        levers += crossZxy(load(geometry.offset + 3 * s), one);
      }
      F[e - first] = sum;
      A[e - first] = moments + yzx(levers);
    }
    for (int e = first; e < last; ++e) A[e - first] = loadMat3(geometry.frame[e].inverse) * A[e - first];
    for (int e = first; e < last; ++e) {
      SimdVec3 r[N], fi[N];
      arms<N>(geometry.frame[e], r);
      const SimdVec3 share = (1.0 / N) * F[e - first];
      for (int i = 0; i < N; ++i) fi[i] = share + cross(A[e - first], r[i]);
      corners<N>(tie, e).add(fi, f);
    }
  });
}

void distributeLoads(const TieView& tie, TieGeometry geometry, const double* force, const double* moment, double* f,
                     double* t) {
  byCorners(tie, [&](auto n) TIEFMU_INLINED {
    constexpr int N = decltype(n)::value;
    switch (tie.coupling) {
      case Coupling::rotation: return distributeRotation<N>(tie, geometry.offset, force, moment, f, t);
      case Coupling::meanMotion: return distributeMeanMotion<N>(tie, geometry, force, moment, f);
      case Coupling::translation: return distributeTranslation<N>(tie, force, f);
    }
  });
}

template <int N>
TIEFMU_INLINE void biasRotation(const TieView& tie, const double* offset, const double* spin, double* as) {
  const double* weight = weights<N>(tie);
  eachSegment<N>(tie, [&](int, Corners<N> nodes, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    SimdVec3 wi[N];
    nodes.gather(spin, wi);
    for (; s < last; ++s) {
      const SimdVec3 w = weighted<N>(weight + N * s, wi);
      store(as + 3 * s, load(as + 3 * s) + cross(w, cross(w, load(offset + 3 * s))));
    }
  });
}

// Theory (2.8): z_b = -Ibar^-1 (dIbar/dt) w, dIbar/dt = sum 2 (r.r') 1 - r' r^T - r r'^T.
template <int N>
TIEFMU_INLINE void biasMeanMotion(const TieView& tie, TieGeometry geometry, const double* v, double* as, double* zs) {
  eachSegment<N>(tie, [&](int e, Corners<N> nodes, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    SimdVec3 vi[N], r[N];
    nodes.gather(v, vi);
    const SegmentFrame& frame = geometry.frame[e];
    arms<N>(frame, r);
    const SimdMat3 inverse = loadMat3(frame.inverse);
    const SimdVec3 w = inverse * angularMomentum<N>(r, vi), centre = mean<N>(vi);
    SimdVec3 rate = {};
    for (int i = 0; i < N; ++i) {
      const SimdVec3 rDot = vi[i] - centre;
      rate += (2 * dot(r[i], rDot)) * w - dot(r[i], w) * rDot - dot(rDot, w) * r[i];
    }
    const SimdVec3 z = -(inverse * rate);
    for (; s < last; ++s) {
      const SimdVec3 d = load(geometry.offset + 3 * s);
      store(as + 3 * s, load(as + 3 * s) + cross(z, d) + cross(w, cross(w, d)));
      store(zs + 3 * s, load(zs + 3 * s) + z);
    }
  });
}

void addBias(const TieView& tie, TieGeometry geometry, const double* velocity, const double* spin, double* as,
             double* zs) {
  byCorners(tie, [&](auto n) TIEFMU_INLINED {
    constexpr int N = decltype(n)::value;
    switch (tie.coupling) {
      case Coupling::rotation: return biasRotation<N>(tie, geometry.offset, spin, as);
      case Coupling::meanMotion: return biasMeanMotion<N>(tie, geometry, velocity, as, zs);
      case Coupling::translation: return;
    }
  });
}

void place(const TieView& tie, TieGeometry geometry, const double* position, double* xs) {
  byCorners(tie, [&](auto n) TIEFMU_INLINED {
    constexpr int N = decltype(n)::value;
    const double* weight = weights<N>(tie);
    const bool centred = tie.coupling == Coupling::meanMotion;
    eachSegment<N>(tie, [&](int, Corners<N> nodes, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
      SimdVec3 xi[N];
      nodes.gather(position, xi);
      const SimdVec3 centre = mean<N>(xi);
      for (; s < last; ++s)
        store(xs + 3 * s, (centred ? centre : weighted<N>(weight + N * s, xi)) + load(geometry.offset + 3 * s));
    });
  });
}

}  // namespace
}  // namespace tiefmu
