// The kernels of surface_solve.hpp, compiled in each build under its own flags. Nothing here may use a function that
// another build shares.
#include "lanes.ipp"
#include "surface_solve.hpp"

namespace tiefmu {
namespace {

TIEFMU_INLINE double sum(Simd4 l) { return (l[0] + l[1]) + (l[2] + l[3]); }
TIEFMU_INLINE Simd4 same(double x) { return Simd4{x, x, x, x}; }
TIEFMU_INLINE void put(double* p, const Simd4& l) { __builtin_memcpy(p, &l, sizeof l); }
TIEFMU_INLINE Simd4Vec3 lanes3(const double* p) { return {lanes(p), lanes(p + 4), lanes(p + 8)}; }
TIEFMU_INLINE void put3(double* p, const Simd4Vec3& v) {
  put(p, v.x);
  put(p + 4, v.y);
  put(p + 8, v.z);
}
TIEFMU_INLINE Symmetric lanesSymmetric(const double* p) {
  return {lanes(p), lanes(p + 4), lanes(p + 8), lanes(p + 12), lanes(p + 16), lanes(p + 20)};
}
TIEFMU_INLINE void putSymmetric(double* p, const Symmetric& m) {
  put3(p, {m.xx, m.xy, m.xz});
  put3(p + 12, {m.yy, m.yz, m.zz});
}

// Three numbers from place `at` on of the four nodes at a corner.
TIEFMU_INLINE Simd4Vec3 gather(const int* node, int width, const double* field, int at) {
  const auto p = [&](int k) TIEFMU_INLINED { return field + static_cast<std::ptrdiff_t>(width) * node[k] + at; };
  return loadFour(p(0), p(1), p(2), p(3));
}
TIEFMU_INLINE void scatter(const int* node, int width, const Simd4Vec3& value, double* field, int at) {
  const auto p = [&](int k) TIEFMU_INLINED { return field + static_cast<std::ptrdiff_t>(width) * node[k] + at; };
  addFour(value, p(0), p(1), p(2), p(3));
}
TIEFMU_INLINE void scatter(const int* node, int width, const Symmetric& m, double* field, int at) {
  scatter(node, width, Simd4Vec3{m.xx, m.xy, m.xz}, field, at);
  scatter(node, width, Simd4Vec3{m.yy, m.yz, m.zz}, field, at + 3);
}

template <int N, bool turns>
TIEFMU_INLINE void shapes(const SurfacePart& part, const SurfaceShape& shape, double* block) {
  using namespace shapePlane;
  const int* index = shape.index;
  for (int e = 0; e < part.fours; ++e) {
    const int* corner = part.corner + 4 * N * e;
    Simd4 a[N] = {};
    Simd4Vec3 c[N] = {};
    Symmetric w[N] = {};
    for (int s = part.firstSlave[e]; s < part.firstSlave[e + 1]; ++s, index += 4) {
      double* plane = part.planes + static_cast<std::ptrdiff_t>(4 * count) * s;
      const Simd4 m = lanes(plane + 4 * mass);
      Simd4Vec3 md = {};
      Symmetric own = {};
      if (turns && shape.offset) {
        const auto at = [&](int k) TIEFMU_INLINED { return shape.offset + 3 * static_cast<std::ptrdiff_t>(index[k]); };
        const Simd4Vec3 d = loadFour(at(0), at(1), at(2), at(3));
        put3(plane + 4 * offset, d);
        md = m * d;
        addInertia(m, d, own);
        const Simd4 I = lanes(plane + 4 * inertia);
        own.xx += I;
        own.yy += I;
        own.zz += I;
      }
      for (int i = 0; i < N; ++i) {
        const Simd4 phi = lanes(plane + 4 * (weight + i)), share = phi * phi;
        a[i] += share * m;
        if constexpr (turns) {
          c[i] += share * md;
          w[i].xx += share * own.xx;
          w[i].xy += share * own.xy;
          w[i].xz += share * own.xz;
          w[i].yy += share * own.yy;
          w[i].yz += share * own.yz;
          w[i].zz += share * own.zz;
        }
      }
    }
    for (int i = 0; i < N; ++i) {
      const Simd4 zero = {};
      scatter(corner + 4 * i, nodeBlock::count, Symmetric{a[i], zero, zero, a[i], zero, a[i]}, block,
              nodeBlock::translation);
      if constexpr (turns) {
        scatter(corner + 4 * i, nodeBlock::count, c[i], block, nodeBlock::lever);
        scatter(corner + 4 * i, nodeBlock::count, w[i], block, nodeBlock::rotation);
      }
    }
  }
}

TIEFMU_INLINE Simd4Vec3 loadSlaves(const double* field, const int* slave) {
  const auto at = [&](int k) TIEFMU_INLINED { return field + 3 * static_cast<std::ptrdiff_t>(slave[k]); };
  return loadFour(at(0), at(1), at(2), at(3));
}

template <int N, bool turns>
TIEFMU_INLINE double leftByShapes(const SurfacePart& part, const double* offset, const SegmentLoads& loads,
                                  const double* a, const double* z, double* residual) {
  using namespace shapePlane;
  Simd4 fastest = {};
  for (int e = 0; e < part.fours; ++e) {
    const int *corner = part.corner + 4 * N * e, *node = part.node + 4 * N * e;
    Simd4Vec3 ai[N], zi[N] = {}, wi[N] = {}, f[N] = {}, t[N] = {};
    for (int i = 0; i < N; ++i) {
      ai[i] = gather(node + 4 * i, 3, a, 0);
      if constexpr (turns) zi[i] = gather(node + 4 * i, 3, z, 0);
      if (turns && loads.velocity) wi[i] = gather(node + 4 * i, 3, loads.spin, 0);
    }
    for (int s = part.firstSlave[e]; s < part.firstSlave[e + 1]; ++s) {
      const double* plane = part.planes + static_cast<std::ptrdiff_t>(4 * count) * s;
      const int* slave = part.slave + static_cast<std::ptrdiff_t>(4) * s;
      Simd4 phi[N];
      for (int i = 0; i < N; ++i) phi[i] = lanes(plane + 4 * (weight + i));
      Simd4Vec3 as = phi[0] * ai[0], zs = phi[0] * zi[0];
      for (int i = 1; i < N; ++i) {
        as += phi[i] * ai[i];
        if constexpr (turns) zs += phi[i] * zi[i];
      }
      Simd4Vec3 d = {};
      if constexpr (turns) {
        d = loadSlaves(offset, slave);
        as += cross(zs, d);
        if (loads.velocity) {
          Simd4Vec3 w = phi[0] * wi[0];
          for (int i = 1; i < N; ++i) w += phi[i] * wi[i];
          const Simd4 w2 = dot(w, w);
          fastest = w2 > fastest ? w2 : fastest;
          as += cross(w, cross(w, d));
        }
      }
      const Simd4Vec3 force = loadSlaves(loads.slaveForce, slave) - lanes(plane + 4 * mass) * as;
      for (int i = 0; i < N; ++i) f[i] += phi[i] * force;
      if constexpr (turns) {
        const Simd4Vec3 moment =
            loadSlaves(loads.slaveMoment, slave) - lanes(plane + 4 * inertia) * zs + cross(d, force);
        for (int i = 0; i < N; ++i) t[i] += phi[i] * moment;
      }
    }
    for (int i = 0; i < N; ++i) {
      scatter(corner + 4 * i, part.width, f[i], residual, 0);
      if constexpr (turns) scatter(corner + 4 * i, part.width, t[i], residual, 3);
    }
  }
  return largest(fastest);
}

// The acceleration of the centre and the angular one, w' = Ibar^-1 (sum r x (a - 2 w x v) + w x L), L = sum r x v.
template <int N>
TIEFMU_INLINE double leftByMean(const SurfacePart& part, const double* offset, const SegmentLoads& loads,
                                const double* a, double* residual) {
  using namespace meanPlane;
  constexpr double share = 1.0 / N;
  Simd4 fastest = {};
  for (int e = 0; e < part.fours; ++e) {
    const int *corner = part.corner + 4 * N * e, *node = part.node + 4 * N * e;
    const double* plane = part.planes + static_cast<std::ptrdiff_t>(4 * count) * e;
    Simd4Vec3 r[N], centre = {}, angular = {}, force = {}, moment = {};
    for (int i = 0; i < N; ++i) {
      const Simd4Vec3 ai = gather(node + 4 * i, 3, a, 0);
      r[i] = lanes3(plane + 4 * (arm + 3 * i));
      centre += ai;
      angular += cross(r[i], ai);
    }
    for (int s = part.firstSlave[e]; s < part.firstSlave[e + 1]; ++s) {
      const int* slave = part.slave + static_cast<std::ptrdiff_t>(4) * s;
      const Simd4 there = lanes(part.there + static_cast<std::ptrdiff_t>(4) * s);
      const Simd4Vec3 one = loadSlaves(loads.slaveForce, slave);
      force += there * one;
      moment += there * (loadSlaves(loads.slaveMoment, slave) + cross(loadSlaves(offset, slave), one));
    }
    const Symmetric ibar = lanesSymmetric(plane + 4 * inverseIbar), J = lanesSymmetric(plane + 4 * inertia);
    const Simd4Vec3 S = lanes3(plane + 4 * meanPlane::moment);
    if (loads.velocity) {
      Simd4Vec3 v[N], momentum = {}, shear = {};
      Simd4 stretch = {};
      for (int i = 0; i < N; ++i) {
        v[i] = gather(node + 4 * i, 3, loads.velocity, 0);
        momentum += cross(r[i], v[i]);
      }
      const Simd4Vec3 w = ibar * momentum;
      const Simd4 w2 = dot(w, w);
      fastest = w2 > fastest ? w2 : fastest;
      for (int i = 0; i < N; ++i) {
        stretch += dot(r[i], v[i]);
        shear += dot(r[i], w) * v[i];
      }
      angular += cross(w, momentum) + 2.0 * (shear - stretch * w);
      force -= cross(w, cross(w, S));
      moment -= cross(w, J * w);
    }
    const Simd4Vec3 turn = ibar * angular;
    centre = share * centre;
    force -= lanes(plane + 4 * mass) * centre + cross(turn, S);
    moment -= cross(S, centre) + J * turn;
    const Simd4Vec3 f = share * force, g = ibar * moment;
    for (int i = 0; i < N; ++i) scatter(corner + 4 * i, part.width, f + cross(g, r[i]), residual, 0);
  }
  return largest(fastest);
}

template <int N, bool turns> TIEFMU_INLINE double timesShapes(const SurfacePart& part, const double* in, double* out) {
  using namespace shapePlane;
  constexpr int width = turns ? 6 : 3;
  Simd4 energy = {};
  for (int e = 0; e < part.fours; ++e) {
    const int* corner = part.corner + 4 * N * e;
    Simd4Vec3 v[N], w[N] = {}, f[N] = {}, t[N] = {};
    for (int i = 0; i < N; ++i) {
      v[i] = gather(corner + 4 * i, width, in, 0);
      if constexpr (turns) w[i] = gather(corner + 4 * i, width, in, 3);
    }
    for (int s = part.firstSlave[e]; s < part.firstSlave[e + 1]; ++s) {
      const double* plane = part.planes + static_cast<std::ptrdiff_t>(4 * count) * s;
      Simd4 phi[N];
      for (int i = 0; i < N; ++i) phi[i] = lanes(plane + 4 * (weight + i));
      Simd4Vec3 vs = phi[0] * v[0], ws = phi[0] * w[0];
      for (int i = 1; i < N; ++i) {
        vs += phi[i] * v[i];
        if constexpr (turns) ws += phi[i] * w[i];
      }
      if constexpr (!turns) {
        const Simd4Vec3 force = lanes(plane + 4 * mass) * vs;
        energy += dot(force, vs);
        for (int i = 0; i < N; ++i) f[i] += phi[i] * force;
        continue;
      }
      const Simd4Vec3 d = lanes3(plane + 4 * offset);
      vs += cross(ws, d);
      const Simd4Vec3 force = lanes(plane + 4 * mass) * vs, moment = lanes(plane + 4 * inertia) * ws;
      energy += dot(force, vs) + dot(moment, ws);
      const Simd4Vec3 about = moment + cross(d, force);
      for (int i = 0; i < N; ++i) {
        f[i] += phi[i] * force;
        t[i] += phi[i] * about;
      }
    }
    for (int i = 0; i < N; ++i) {
      scatter(corner + 4 * i, width, f[i], out, 0);
      if constexpr (turns) scatter(corner + 4 * i, width, t[i], out, 3);
    }
  }
  return sum(energy);
}

// With V = (a, w) of the centre, K V for the corners' v_i: a = sum v_i / n, w = Ibar^-1 sum r_i x v_i.
template <int N> TIEFMU_INLINE void mean(const SurfacePart& part, const SurfaceShape& shape, double* block) {
  using namespace meanPlane;
  constexpr double share = 1.0 / N;
  for (int e = 0; e < part.fours; ++e) {
    const int *corner = part.corner + 4 * N * e, *index = shape.index + 4 * e;
    double* plane = part.planes + static_cast<std::ptrdiff_t>(4 * count) * e;
    const SegmentFrame* frame[4];
    for (int k = 0; k < 4; ++k) frame[k] = shape.frame + index[k];
    Simd4Vec3 r[N];
    for (int i = 0; i < N; ++i) {
      r[i] = loadFour(frame[0]->arm + 3 * i, frame[1]->arm + 3 * i, frame[2]->arm + 3 * i, frame[3]->arm + 3 * i);
      put3(plane + 4 * (arm + 3 * i), r[i]);
    }
    const auto column = [&](int k) TIEFMU_INLINED {
      return loadFour(frame[0]->inverse + 3 * k, frame[1]->inverse + 3 * k, frame[2]->inverse + 3 * k,
                      frame[3]->inverse + 3 * k);
    };
    const Simd4Vec3 first = column(0), second = column(1), third = column(2);
    const Symmetric ibar = {first.x, first.y, first.z, second.y, second.z, third.z};
    putSymmetric(plane + 4 * inverseIbar, ibar);
    const Simd4 m = lanes(plane + 4 * mass);
    Simd4Vec3 S = lanes3(plane + 4 * atStart);
    Symmetric J = lanesSymmetric(plane + 4 * (atStart + 3));
    if (shape.rotation) {
      const double* at[4];
      for (int k = 0; k < 4; ++k) at[k] = shape.rotation + 4 * static_cast<std::ptrdiff_t>(index[k]);
      turnBody(at, S, J);
    }
    put3(plane + 4 * moment, S);
    putSymmetric(plane + 4 * inertia, J);
    const Simd4 direct = (share * share) * m;
    for (int i = 0; i < N; ++i) {
      // P = Ibar^-1 [r]: m/n^2 - ([S] P + its transpose)/n + P^T J P
      const Simd4 zero = {};
      const Simd4Vec3 p[3] = {ibar * Simd4Vec3{zero, r[i].z, -r[i].y}, ibar * Simd4Vec3{-r[i].z, zero, r[i].x},
                              ibar * Simd4Vec3{r[i].y, -r[i].x, zero}};
      const Simd4Vec3 j[3] = {J * p[0], J * p[1], J * p[2]};
      const Simd4Vec3 s[3] = {cross(S, p[0]), cross(S, p[1]), cross(S, p[2])};
      scatter(corner + 4 * i, nodeBlock::count,
              Symmetric{direct - (2 * share) * s[0].x + dot(p[0], j[0]), dot(p[0], j[1]) - share * (s[0].y + s[1].x),
                        dot(p[0], j[2]) - share * (s[0].z + s[2].x), direct - (2 * share) * s[1].y + dot(p[1], j[1]),
                        dot(p[1], j[2]) - share * (s[1].z + s[2].y), direct - (2 * share) * s[2].z + dot(p[2], j[2])},
              block, nodeBlock::translation);
    }
  }
}

template <int N> TIEFMU_INLINE double timesMean(const SurfacePart& part, const double* in, double* out) {
  using namespace meanPlane;
  constexpr double share = 1.0 / N;
  Simd4 energy = {};
  for (int e = 0; e < part.fours; ++e) {
    const int* corner = part.corner + 4 * N * e;
    const double* plane = part.planes + static_cast<std::ptrdiff_t>(4 * count) * e;
    Simd4Vec3 r[N], a = {}, angular = {};
    for (int i = 0; i < N; ++i) {
      const Simd4Vec3 v = gather(corner + 4 * i, part.width, in, 0);
      r[i] = lanes3(plane + 4 * (arm + 3 * i));
      a += v;
      angular += cross(r[i], v);
    }
    a = share * a;
    const Symmetric ibar = lanesSymmetric(plane + 4 * inverseIbar), J = lanesSymmetric(plane + 4 * inertia);
    const Simd4Vec3 w = ibar * angular, S = lanes3(plane + 4 * moment);
    const Simd4Vec3 force = lanes(plane + 4 * mass) * a + cross(w, S), about = cross(S, a) + J * w;
    energy += dot(force, a) + dot(about, w);
    const Simd4Vec3 f = share * force, g = ibar * about;
    for (int i = 0; i < N; ++i) scatter(corner + 4 * i, part.width, f + cross(g, r[i]), out, 0);
  }
  return sum(energy);
}

void prepareShapes(const SurfacePart& part, const SurfaceShape& shape, double* block) {
  if (part.corners == 4)
    return part.width == 6 ? shapes<4, true>(part, shape, block) : shapes<4, false>(part, shape, block);
  return part.width == 6 ? shapes<3, true>(part, shape, block) : shapes<3, false>(part, shape, block);
}
void prepareMean(const SurfacePart& part, const SurfaceShape& shape, double* block) {
  return part.corners == 4 ? mean<4>(part, shape, block) : mean<3>(part, shape, block);
}
double leaveShapes(const SurfacePart& part, bool turns, const double* offset, const SegmentLoads& loads,
                   const double* a, const double* z, double* residual) {
  if (part.corners == 4)
    return turns ? leftByShapes<4, true>(part, offset, loads, a, z, residual)
                 : leftByShapes<4, false>(part, offset, loads, a, z, residual);
  return turns ? leftByShapes<3, true>(part, offset, loads, a, z, residual)
               : leftByShapes<3, false>(part, offset, loads, a, z, residual);
}
double leaveMean(const SurfacePart& part, const double* offset, const SegmentLoads& loads, const double* a,
                 double* residual) {
  return part.corners == 4 ? leftByMean<4>(part, offset, loads, a, residual)
                           : leftByMean<3>(part, offset, loads, a, residual);
}
double multiplyShapes(const SurfacePart& part, const double* in, double* out) {
  if (part.corners == 4)
    return part.width == 6 ? timesShapes<4, true>(part, in, out) : timesShapes<4, false>(part, in, out);
  return part.width == 6 ? timesShapes<3, true>(part, in, out) : timesShapes<3, false>(part, in, out);
}
double multiplyMean(const SurfacePart& part, const double* in, double* out) {
  return part.corners == 4 ? timesMean<4>(part, in, out) : timesMean<3>(part, in, out);
}

// Inverse by L D L^T; `good` turns 0 in lanes where a pivot is lost in rounding.
TIEFMU_INLINE Symmetric inverseOrLost(const Symmetric& m, Simd4& good) {
  constexpr double lost = 1e-13;
  const Simd4 d0 = 1.0 / m.xx, l10 = m.xy * d0, l20 = m.xz * d0;
  const Simd4 p1 = m.yy - l10 * m.xy, d1 = 1.0 / p1, l21 = (m.yz - l20 * m.xy) * d1;
  const Simd4 p2 = m.zz - l20 * m.xz - l21 * l21 * p1, d2 = 1.0 / p2, m20 = l10 * l21 - l20;
  const Simd4 zero = {};
  good = m.xx > 0 ? good : zero;
  good = p1 > lost * m.yy ? good : zero;
  good = p2 > lost * m.zz ? good : zero;
  Symmetric inverse;
  inverse.zz = d2;
  inverse.yz = -l21 * d2;
  inverse.yy = d1 - l21 * inverse.yz;
  inverse.xz = m20 * d2;
  inverse.xy = -l10 * d1 - l21 * inverse.xz;
  inverse.xx = d0 + l10 * l10 * d1 + m20 * inverse.xz;
  return inverse;
}

// Loads of four nodes next to each other, `stride` apart.
TIEFMU_INLINE Simd4Vec3 neighbours(const double* p, int stride) {
  return loadFour(p, p + stride, p + 2 * stride, p + 3 * stride);
}
TIEFMU_INLINE Symmetric neighboursSymmetric(const double* p, int stride) {
  const Simd4Vec3 first = neighbours(p, stride), second = neighbours(p + 3, stride);
  return {first.x, first.y, first.z, second.x, second.y, second.z};
}

bool invert(int width, int first, int last, const SurfaceVectors& all) {
  Simd4 good = {1, 1, 1, 1};
  for (int q = first; q < last; ++q) {
    const double* block = all.block + static_cast<std::ptrdiff_t>(4 * nodeBlock::count) * q;
    double* to = all.inverse + static_cast<std::ptrdiff_t>(4 * nodeBlock::count) * q;
    const Symmetric a = inverseOrLost(neighboursSymmetric(block + nodeBlock::translation, nodeBlock::count), good);
    putSymmetric(to + 4 * nodeBlock::translation, a);
    if (width == 3) continue;
    const Simd4Vec3 c = neighbours(block + nodeBlock::lever, nodeBlock::count);
    Symmetric w = neighboursSymmetric(block + nodeBlock::rotation, nodeBlock::count);
    // W + [c] A^-1 [c], by columns of [c]: c x e
    const Simd4 zero = {};
    const Simd4Vec3 x = {zero, c.z, -c.y}, y = {-c.z, zero, c.x}, z = {c.y, -c.x, zero};
    const Simd4Vec3 ax = a * x, ay = a * y, az = a * z;
    w.xx -= dot(x, ax);
    w.xy -= dot(x, ay);
    w.xz -= dot(x, az);
    w.yy -= dot(y, ay);
    w.yz -= dot(y, az);
    w.zz -= dot(z, az);
    put3(to + 4 * nodeBlock::lever, c);
    putSymmetric(to + 4 * nodeBlock::rotation, inverseOrLost(w, good));
  }
  return good[0] != 0 && good[1] != 0 && good[2] != 0 && good[3] != 0;
}

struct Twist { Simd4Vec3 v, w; };

// B r of four nodes.
TIEFMU_INLINE Twist ofInverse(const double* inverse, int width, const Twist& r) {
  const Symmetric a = lanesSymmetric(inverse + 4 * nodeBlock::translation);
  const Simd4Vec3 first = a * r.v;
  if (width == 3) return {first, Simd4Vec3{}};
  const Simd4Vec3 c = lanes3(inverse + 4 * nodeBlock::lever);
  const Simd4Vec3 w = lanesSymmetric(inverse + 4 * nodeBlock::rotation) * (r.w - cross(c, first));
  return {first + a * cross(c, w), w};
}
TIEFMU_INLINE Twist loadTwist(const double* p, int width) {
  return {neighbours(p, width), width == 6 ? neighbours(p + 3, width) : Simd4Vec3{}};
}
TIEFMU_INLINE Simd4 dot(const Twist& p, const Twist& q) { return dot(p.v, q.v) + dot(p.w, q.w); }

// What part of the inertia of four nodes is slaves'.
TIEFMU_INLINE Simd4 slaves(const double* own, int stride, const Symmetric& all) {
  return 1.0 - 3.0 * neighbours(own, stride).x / (all.xx + all.yy + all.zz);
}

Sums measure(int width, int first, int last, const SurfaceVectors& all) {
  Simd4 left = {}, size = {}, shared = {};
  for (int q = first; q < last; ++q) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(4 * width) * q;
    const double* block = all.block + static_cast<std::ptrdiff_t>(4 * nodeBlock::count) * q;
    const Twist r = loadTwist(all.residual + at, width), x = loadTwist(all.x + at, width);
    const Twist y = ofInverse(all.inverse + static_cast<std::ptrdiff_t>(4 * nodeBlock::count) * q, width, r);
    const Symmetric a = neighboursSymmetric(block + nodeBlock::translation, nodeBlock::count);
    Simd4 share = slaves(all.own + at, width, a);
    Twist b = {a * x.v, Simd4Vec3{}};
    if (width == 6) {
      const Simd4Vec3 c = neighbours(block + nodeBlock::lever, nodeBlock::count);
      const Symmetric w = neighboursSymmetric(block + nodeBlock::rotation, nodeBlock::count);
      const Simd4 turning = slaves(all.own + at + 3, width, w);
      share = turning > share ? turning : share;
      b.v += cross(x.w, c);
      b.w = cross(c, x.v) + w * x.w;
    }
    left += dot(r, y);
    const Simd4 own = dot(Twist{y.v + x.v, y.w + x.w}, Twist{b.v + r.v, b.w + r.w});
    size += own;
    shared += share * own;
  }
  return {sum(left), sum(size), sum(shared)};
}

TIEFMU_INLINE void scale(int width, int q, const SurfaceVectors& all, Simd4& rho, Simd4& energy) {
  const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(4 * width) * q;
  const Twist r = loadTwist(all.residual + at, width);
  const Twist z = ofInverse(all.inverse + static_cast<std::ptrdiff_t>(4 * nodeBlock::count) * q, width, r);
  rho += dot(r, z);
  double* to = all.scaled + at;
  storeFour(z.v, to, to + width, to + 2 * width, to + 3 * width);
  if (width == 6) storeFour(z.w, to + 3, to + width + 3, to + 2 * width + 3, to + 3 * width + 3);
  for (int k = 0; k < width; ++k) {
    const Simd4 value = lanes(to + 4 * k), own = lanes(all.own + at + 4 * k) * value;
    put(all.product + at + 4 * k, own);
    energy += value * own;
  }
}

Sums start(int width, int first, int last, const SurfaceVectors& all) {
  Simd4 rho = {}, energy = {};
  for (int q = first; q < last; ++q) scale(width, q, all, rho, energy);
  return {sum(rho), sum(energy)};
}

Sums advance(int width, int first, int last, double alpha, double beta, const SurfaceVectors& all) {
  Simd4 rho = {}, energy = {};
  const Simd4 a = same(alpha), b = same(beta);
  for (int q = first; q < last; ++q) {
    const std::ptrdiff_t begin = static_cast<std::ptrdiff_t>(4 * width) * q;
    for (int k = 0; k < width; ++k) {
      const std::ptrdiff_t at = begin + 4 * k;
      const Simd4 p = lanes(all.scaled + at) + b * lanes(all.direction + at);
      const Simd4 s = lanes(all.product + at) + b * lanes(all.image + at);
      put(all.direction + at, p);
      put(all.image + at, s);
      put(all.x + at, lanes(all.x + at) + a * p);
      put(all.residual + at, lanes(all.residual + at) - a * s);
    }
    scale(width, q, all, rho, energy);
  }
  return {sum(rho), sum(energy)};
}

}  // namespace

const SurfaceKernels TIEFMU_SURFACE_KERNELS = {leaveShapes,  leaveMean, prepareShapes, prepareMean, multiplyShapes,
                                               multiplyMean, invert,    measure,       start,       advance};

}  // namespace tiefmu
