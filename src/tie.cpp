#include "tie.hpp"

#define TIEFMU_INLINE inline __attribute__((always_inline))
#define TIEFMU_INLINED __attribute__((always_inline))  // for lambdas

namespace tiefmu {
namespace {

// x, y in one register and z in another, which baseline x86-64 (and every other 16-byte vector unit) serves. Builds of
// these kernels for AVX2 and AVX-512 were measured at 0.95 to 1.25 times the speed: not worth a second code path.
using Pair = double __attribute__((vector_size(16)));
struct Pack {
  Pair xy;
  double z;
  double operator[](int k) const { return k < 2 ? xy[k] : z; }
};

TIEFMU_INLINE Pack load(const double* p) { return {Pair{p[0], p[1]}, p[2]}; }
TIEFMU_INLINE void store(double* p, Pack a) {
  p[0] = a.xy[0];
  p[1] = a.xy[1];
  p[2] = a.z;
}
TIEFMU_INLINE Pack operator+(Pack a, Pack b) { return {a.xy + b.xy, a.z + b.z}; }
TIEFMU_INLINE Pack operator-(Pack a, Pack b) { return {a.xy - b.xy, a.z - b.z}; }
TIEFMU_INLINE Pack operator-(Pack a) { return {-a.xy, -a.z}; }
TIEFMU_INLINE Pack operator*(double s, Pack a) { return {s * a.xy, s * a.z}; }
TIEFMU_INLINE Pack operator*(Pack a, double s) { return {a.xy * s, a.z * s}; }
TIEFMU_INLINE Pack& operator+=(Pack& a, Pack b) { return a = a + b; }
TIEFMU_INLINE Pack cross(Pack a, Pack b) {
  const Pair ayz = {a.xy[1], a.z}, byz = {b.xy[1], b.z}, azx = {a.z, a.xy[0]}, bzx = {b.z, b.xy[0]};
  return {ayz * bzx - azx * byz, a.xy[0] * b.xy[1] - a.xy[1] * b.xy[0]};
}
TIEFMU_INLINE double dot(Pack a, Pack b) {
  const Pair p = a.xy * b.xy;
  return p[0] + p[1] + a.z * b.z;
}
TIEFMU_INLINE Pack symmetric(const double* m, Pack a) {
  return Pack{{m[0], m[1]}, m[2]} * a.xy[0] + Pack{{m[1], m[3]}, m[4]} * a.xy[1] + Pack{{m[2], m[4]}, m[5]} * a.z;
}

template <int N>
struct Corners {
  const int* node;
  TIEFMU_INLINE void gather(const double* field, Pack* to) const {
    for (int i = 0; i < N; ++i) to[i] = load(field + 3 * static_cast<std::ptrdiff_t>(node[i]));
  }
  TIEFMU_INLINE void add(const Pack* from, double* field) const {
    for (int i = 0; i < N; ++i) {
      double* p = field + 3 * static_cast<std::ptrdiff_t>(node[i]);
      store(p, load(p) + from[i]);
    }
  }
};

template <int N>
TIEFMU_INLINE Pack weighted(const double* phi, const Pack* u) {
  Pack sum = phi[0] * u[0];
  for (int i = 1; i < N; ++i) sum += phi[i] * u[i];
  return sum;
}

template <int N>
TIEFMU_INLINE Pack mean(const Pack* u) {
  Pack sum = u[0];
  for (int i = 1; i < N; ++i) sum += u[i];
  return sum * (1.0 / N);
}

template <int N>
TIEFMU_INLINE Pack rigidSpin(const double* arm, const double* inverse, const Pack* v) {
  Pack sum = cross(load(arm), v[0]);
  for (int i = 1; i < N; ++i) sum += cross(load(arm + 3 * i), v[i]);
  return symmetric(inverse, sum);
}

// Arms from the centre of the nodes, and Ibar^-1.
template <int N>
TIEFMU_INLINE void frameOf(const Pack* x, SegmentFrame& frame) {
  const Pack centre = mean<N>(x);
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  for (int i = 0; i < N; ++i) {
    const Pack r = x[i] - centre;
    store(frame.arm + 3 * i, r);
    xx += r[0] * r[0];
    xy += r[0] * r[1];
    xz += r[0] * r[2];
    yy += r[1] * r[1];
    yz += r[1] * r[2];
    zz += r[2] * r[2];
  }
  store(frame.centre, centre);
  const double a = yy + zz, b = -xy, c = -xz, d = xx + zz, e = -yz, f = xx + yy;
  const double A = d * f - e * e, B = c * e - b * f, C = b * e - c * d;
  const double s = 1.0 / (a * A + b * B + c * C);
  frame.inverse[0] = s * A;
  frame.inverse[1] = s * B;
  frame.inverse[2] = s * C;
  frame.inverse[3] = s * (a * f - c * c);
  frame.inverse[4] = s * (b * c - a * e);
  frame.inverse[5] = s * (a * d - b * b);
}

// Calls body(segment, corners, first slave, last slave) over a range; slaves as indices of the slave arrays.
template <int N, class Body>
TIEFMU_INLINE void eachSegment(const TieGroup& group, SegmentRange range, Body body) {
  const int* node = group.node.data();
  const int* begin = group.begin.data();
  for (int e = range.first; e < range.last; ++e)
    body(e, Corners<N>{node + N * static_cast<std::ptrdiff_t>(e)},
         static_cast<std::ptrdiff_t>(group.firstSlave) + begin[e],
         static_cast<std::ptrdiff_t>(group.firstSlave) + begin[e + 1]);
}

template <int N>
TIEFMU_INLINE void followTranslation(const TieGroup& group, SegmentRange range, const double* u, double* us) {
  const double* weight = group.weight.data() - N * static_cast<std::ptrdiff_t>(group.firstSlave);
  eachSegment<N>(group, range, [&](int, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack ui[N];
    corners.gather(u, ui);
    for (; s < last; ++s) store(us + 3 * s, weighted<N>(weight + N * s, ui));
  });
}

template <int N>
TIEFMU_INLINE void followRotation(const TieGroup& group, SegmentRange range, const double* offset, const double* u,
                                  const double* turn, double* us, double* turns) {
  const double* weight = group.weight.data() - N * static_cast<std::ptrdiff_t>(group.firstSlave);
  eachSegment<N>(group, range, [&](int, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack ui[N], wi[N];
    corners.gather(u, ui);
    corners.gather(turn, wi);
    for (; s < last; ++s) {
      const Pack w = weighted<N>(weight + N * s, wi);
      store(us + 3 * s, weighted<N>(weight + N * s, ui) + cross(w, load(offset + 3 * s)));
      store(turns + 3 * s, w);
    }
  });
}

template <int N>
TIEFMU_INLINE void followMeanMotion(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* u,
                                    double* us, double* turns) {
  eachSegment<N>(group, range, [&](int e, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack ui[N];
    corners.gather(u, ui);
    const Pack w = rigidSpin<N>(geometry.frame[e].arm, geometry.frame[e].inverse, ui), centre = mean<N>(ui);
    for (; s < last; ++s) {
      store(us + 3 * s, centre + cross(w, load(geometry.offset + 3 * s)));
      store(turns + 3 * s, w);
    }
  });
}

template <int N>
TIEFMU_INLINE void distributeTranslation(const TieGroup& group, SegmentRange range, const double* force, double* f) {
  const double* weight = group.weight.data() - N * static_cast<std::ptrdiff_t>(group.firstSlave);
  eachSegment<N>(group, range, [&](int, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack fi[N] = {};
    for (; s < last; ++s) {
      const Pack F = load(force + 3 * s);
      for (int i = 0; i < N; ++i) fi[i] += weight[N * s + i] * F;
    }
    corners.add(fi, f);
  });
}

template <int N>
TIEFMU_INLINE void distributeRotation(const TieGroup& group, SegmentRange range, const double* offset,
                                      const double* force, const double* moment, double* f, double* t) {
  const double* weight = group.weight.data() - N * static_cast<std::ptrdiff_t>(group.firstSlave);
  eachSegment<N>(group, range, [&](int, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack fi[N] = {}, ti[N] = {};
    for (; s < last; ++s) {
      const Pack F = load(force + 3 * s);
      const Pack M = load(moment + 3 * s) + cross(load(offset + 3 * s), F);
      for (int i = 0; i < N; ++i) {
        fi[i] += weight[N * s + i] * F;
        ti[i] += weight[N * s + i] * M;
      }
    }
    corners.add(fi, f);
    corners.add(ti, t);
  });
}

template <int N>
TIEFMU_INLINE void distributeMeanMotion(const TieGroup& group, SegmentRange range, TieGeometry geometry,
                                        const double* force, const double* moment, double* f) {
  eachSegment<N>(group, range, [&](int e, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack F = {}, M = {};
    for (; s < last; ++s) {
      const Pack load1 = load(force + 3 * s);
      F += load1;
      M += load(moment + 3 * s) + cross(load(geometry.offset + 3 * s), load1);
    }
    const Pack A = symmetric(geometry.frame[e].inverse, M), share = F * (1.0 / N);
    Pack fi[N];
    for (int i = 0; i < N; ++i) fi[i] = share + cross(A, load(geometry.frame[e].arm + 3 * i));
    corners.add(fi, f);
  });
}

template <int N>
TIEFMU_INLINE void biasRotation(const TieGroup& group, SegmentRange range, const double* offset, const double* spin,
                                double* as) {
  const double* weight = group.weight.data() - N * static_cast<std::ptrdiff_t>(group.firstSlave);
  eachSegment<N>(group, range, [&](int, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack wi[N];
    corners.gather(spin, wi);
    for (; s < last; ++s) {
      const Pack w = weighted<N>(weight + N * s, wi);
      store(as + 3 * s, load(as + 3 * s) + cross(w, cross(w, load(offset + 3 * s))));
    }
  });
}

// z_b = -Ibar^-1 (dIbar/dt) w, dIbar/dt = sum 2 (r.r') 1 - r' r^T - r r'^T.
template <int N>
TIEFMU_INLINE void biasMeanMotion(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* v,
                                  double* as, double* zs) {
  eachSegment<N>(group, range, [&](int e, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack vi[N];
    corners.gather(v, vi);
    const SegmentFrame& frame = geometry.frame[e];
    const Pack w = rigidSpin<N>(frame.arm, frame.inverse, vi), centre = mean<N>(vi);
    Pack rate = {};
    for (int i = 0; i < N; ++i) {
      const Pack r = load(frame.arm + 3 * i), rDot = vi[i] - centre;
      rate += 2 * dot(r, rDot) * w - dot(r, w) * rDot - dot(rDot, w) * r;
    }
    const Pack z = -symmetric(frame.inverse, rate);
    for (; s < last; ++s) {
      const Pack d = load(geometry.offset + 3 * s);
      store(as + 3 * s, load(as + 3 * s) + cross(z, d) + cross(w, cross(w, d)));
      store(zs + 3 * s, load(zs + 3 * s) + z);
    }
  });
}

template <int N>
TIEFMU_INLINE void placeWeighted(const TieGroup& group, SegmentRange range, const double* offset, const double* x,
                                 double* xs) {
  const double* weight = group.weight.data() - N * static_cast<std::ptrdiff_t>(group.firstSlave);
  eachSegment<N>(group, range, [&](int, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack xi[N];
    corners.gather(x, xi);
    for (; s < last; ++s) store(xs + 3 * s, weighted<N>(weight + N * s, xi) + load(offset + 3 * s));
  });
}

template <int N>
TIEFMU_INLINE void placeMeanMotion(const TieGroup& group, SegmentRange range, const double* offset, const double* x,
                                   double* xs) {
  eachSegment<N>(group, range, [&](int, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack xi[N];
    corners.gather(x, xi);
    const Pack centre = mean<N>(xi);
    for (; s < last; ++s) store(xs + 3 * s, centre + load(offset + 3 * s));
  });
}

// d + sin(a)/a (angle x d) + (1 - cos a)/a^2 angle x (angle x d), a = |angle| [Rodrigues]
TIEFMU_INLINE Pack rotated(Pack angle, Pack d) {
  const double a2 = dot(angle, angle);
  double s, c;
  if (a2 < 1e-3) {  // a step of 2 degrees; the terms left out are below 1e-17
    s = 1 - a2 * (1.0 / 6) * (1 - a2 * (1.0 / 20) * (1 - a2 * (1.0 / 42)));
    c = 0.5 * (1 - a2 * (1.0 / 12) * (1 - a2 * (1.0 / 30) * (1 - a2 * (1.0 / 56))));
  } else {
    const double a = std::sqrt(a2), half = std::sin(0.5 * a);
    s = std::sin(a) / a;
    c = 2 * half * half / a2;
  }
  const Pack once = cross(angle, d);
  return d + s * once + c * cross(angle, once);
}

template <int N>
TIEFMU_INLINE void turnOffsetsN(const TieGroup& group, SegmentRange range, double h, const double* spin,
                                const double* inverseLength2, double* offset) {
  const double* weight = group.weight.data() - N * static_cast<std::ptrdiff_t>(group.firstSlave);
  eachSegment<N>(group, range, [&](int, Corners<N> corners, std::ptrdiff_t s, std::ptrdiff_t last) TIEFMU_INLINED {
    Pack wi[N];
    corners.gather(spin, wi);
    for (int i = 0; i < N; ++i) wi[i] = h * wi[i];
    for (; s < last; ++s) {
      const Pack d = rotated(weighted<N>(weight + N * s, wi), load(offset + 3 * s));
      // One Newton step of 1/sqrt: exact, as the length is off by rounding only.
      store(offset + 3 * s, (1.5 - 0.5 * dot(d, d) * inverseLength2[s]) * d);
    }
  });
}

template <int N>
TIEFMU_INLINE void moveSegmentsN(const TieGroup& group, SegmentRange range, double h, const double* x, const double* v,
                                 SegmentFrame* frame, double* rotation) {
  eachSegment<N>(group, range, [&](int e, Corners<N> corners, std::ptrdiff_t, std::ptrdiff_t) TIEFMU_INLINED {
    Pack xi[N], vi[N];
    corners.gather(x, xi);
    corners.gather(v, vi);
    for (int i = 0; i < N; ++i) xi[i] += (0.5 * h) * vi[i];
    if (rotation) {
      SegmentFrame middle;
      frameOf<N>(xi, middle);
      const Pack u = (0.5 * h) * rigidSpin<N>(middle.arm, middle.inverse, vi);
      // q <- (1, u) q, scaled to unit length
      double* q = rotation + 4 * static_cast<std::ptrdiff_t>(e);
      const double a = q[0], b = q[1], c = q[2], d = q[3];
      const double w = a - u[0] * b - u[1] * c - u[2] * d, i = b + u[0] * a + u[1] * d - u[2] * c,
                   j = c + u[1] * a + u[2] * b - u[0] * d, k = d + u[2] * a + u[0] * c - u[1] * b;
      const double scale = 1 / std::sqrt(w * w + i * i + j * j + k * k);
      q[0] = scale * w;
      q[1] = scale * i;
      q[2] = scale * j;
      q[3] = scale * k;
    }
    corners.gather(x, xi);  // the end as the positions are advanced, so that a restored state finds the same bits
    for (int i = 0; i < N; ++i) xi[i] += h * vi[i];
    frameOf<N>(xi, frame[e]);
  });
}

}  // namespace

// The public kernels choose the coupling and the number of corners, once per call.

void follow(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* u,
                          const double* turn, double* us, double* turns) {
  const bool quads = group.corners == 4;
  switch (group.coupling) {
    case Coupling::translation:
      return quads ? followTranslation<4>(group, range, u, us) : followTranslation<3>(group, range, u, us);
    case Coupling::rotation:
      return quads ? followRotation<4>(group, range, geometry.offset, u, turn, us, turns)
                   : followRotation<3>(group, range, geometry.offset, u, turn, us, turns);
    case Coupling::meanMotion:
      return quads ? followMeanMotion<4>(group, range, geometry, u, us, turns)
                   : followMeanMotion<3>(group, range, geometry, u, us, turns);
  }
}

void distribute(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* force,
                              const double* moment, double* f, double* t) {
  const bool quads = group.corners == 4;
  switch (group.coupling) {
    case Coupling::translation:
      return quads ? distributeTranslation<4>(group, range, force, f)
                   : distributeTranslation<3>(group, range, force, f);
    case Coupling::rotation:
      return quads ? distributeRotation<4>(group, range, geometry.offset, force, moment, f, t)
                   : distributeRotation<3>(group, range, geometry.offset, force, moment, f, t);
    case Coupling::meanMotion:
      return quads ? distributeMeanMotion<4>(group, range, geometry, force, moment, f)
                   : distributeMeanMotion<3>(group, range, geometry, force, moment, f);
  }
}

void addBias(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* velocity,
                           const double* spin, double* as, double* zs) {
  const bool quads = group.corners == 4;
  switch (group.coupling) {
    case Coupling::translation:
      return;
    case Coupling::rotation:
      return quads ? biasRotation<4>(group, range, geometry.offset, spin, as)
                   : biasRotation<3>(group, range, geometry.offset, spin, as);
    case Coupling::meanMotion:
      return quads ? biasMeanMotion<4>(group, range, geometry, velocity, as, zs)
                   : biasMeanMotion<3>(group, range, geometry, velocity, as, zs);
  }
}

void place(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* position,
                         double* xs) {
  const bool quads = group.corners == 4;
  if (group.coupling == Coupling::meanMotion)
    return quads ? placeMeanMotion<4>(group, range, geometry.offset, position, xs)
                 : placeMeanMotion<3>(group, range, geometry.offset, position, xs);
  return quads ? placeWeighted<4>(group, range, geometry.offset, position, xs)
               : placeWeighted<3>(group, range, geometry.offset, position, xs);
}

void updateFrames(const TieGroup& group, SegmentRange range, const double* position,
                                SegmentFrame* frame) {
  const auto update = [&](auto n) TIEFMU_INLINED {
    constexpr int N = decltype(n)::value;
    eachSegment<N>(group, range, [&](int e, Corners<N> corners, std::ptrdiff_t, std::ptrdiff_t) TIEFMU_INLINED {
      Pack x[N];
      corners.gather(position, x);
      frameOf<N>(x, frame[e]);
    });
  };
  if (group.corners == 4) update(std::integral_constant<int, 4>{});
  else update(std::integral_constant<int, 3>{});
}

void turnOffsets(const TieGroup& group, SegmentRange range, double h, const double* spin,
                               const double* inverseLength2, double* offset) {
  return group.corners == 4 ? turnOffsetsN<4>(group, range, h, spin, inverseLength2, offset)
                            : turnOffsetsN<3>(group, range, h, spin, inverseLength2, offset);
}

void moveSegments(const TieGroup& group, SegmentRange range, double h, const double* position,
                                const double* velocity, SegmentFrame* frame, double* rotation) {
  return group.corners == 4 ? moveSegmentsN<4>(group, range, h, position, velocity, frame, rotation)
                            : moveSegmentsN<3>(group, range, h, position, velocity, frame, rotation);
}

void rotateOffsets(const TieGroup& group, SegmentRange range, const double* rotation,
                                 const double* initialOffset, double* offset) {
  for (int e = range.first; e < range.last; ++e) {
    const double* q = rotation + 4 * static_cast<std::ptrdiff_t>(e);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const Pack c0 = {{1 - 2 * (y * y + z * z), 2 * (x * y + w * z)}, 2 * (x * z - w * y)};
    const Pack c1 = {{2 * (x * y - w * z), 1 - 2 * (x * x + z * z)}, 2 * (y * z + w * x)};
    const Pack c2 = {{2 * (x * z + w * y), 2 * (y * z - w * x)}, 1 - 2 * (x * x + y * y)};
    for (std::ptrdiff_t s = group.firstSlave + group.begin[e]; s < group.firstSlave + group.begin[e + 1]; ++s) {
      const double* d0 = initialOffset + 3 * s;
      store(offset + 3 * s, c0 * d0[0] + c1 * d0[1] + c2 * d0[2]);
    }
  }
}

void meanSpin(const TieGroup& group, SegmentRange range, const SegmentFrame* frame,
                            const double* velocity, double* spin) {
  const auto compute = [&](auto n) TIEFMU_INLINED {
    constexpr int N = decltype(n)::value;
    eachSegment<N>(group, range, [&](int e, Corners<N> corners, std::ptrdiff_t, std::ptrdiff_t) TIEFMU_INLINED {
      Pack v[N];
      corners.gather(velocity, v);
      store(spin + 3 * static_cast<std::ptrdiff_t>(e), rigidSpin<N>(frame[e].arm, frame[e].inverse, v));
    });
  };
  if (group.corners == 4) compute(std::integral_constant<int, 4>{});
  else compute(std::integral_constant<int, 3>{});
}

}  // namespace tiefmu
