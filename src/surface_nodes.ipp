// The passes over nodes of surface_solve.hpp, compiled in each build under its own flags.
#pragma once

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

// What the iteration starts from, at nodes [first, last): x = a, z; r = loads - (own) x.
void begin(int width, int first, int last, const SurfaceNodes& nodes, const SegmentLoads& loads, const double* a,
           const double* z, const SurfaceVectors& all) {
  const auto set = [&](std::ptrdiff_t to, std::ptrdiff_t from, const double* load, const double* value) TIEFMU_INLINED {
    const SimdVec3 x = tiefmu::load(value + from);
    store(all.x + to, x);
    store(all.residual + to, tiefmu::load(load + from) - all.own[to] * x);
  };
  for (int i = first; i < last; ++i) {
    const std::ptrdiff_t to = static_cast<std::ptrdiff_t>(width) * i,
                         from = 3 * static_cast<std::ptrdiff_t>(nodes.node[i]);
    set(to, from, loads.nodeForce, a);
    if (i < nodes.turning) set(to + 3, from, loads.nodeMoment, z);
  }
}

// A vector of the iteration, to (from) arrays of 3 per node (rotating node).
void give(int width, int first, int last, const SurfaceNodes& nodes, const double* x, double* a, double* z) {
  for (int i = first; i < last; ++i) {
    const double* from = x + static_cast<std::ptrdiff_t>(width) * i;
    const std::ptrdiff_t to = 3 * static_cast<std::ptrdiff_t>(nodes.node[i]);
    store(a + to, load(from));
    if (i < nodes.turning) store(z + to, load(from + 3));
  }
}
void take(int width, int first, int last, const SurfaceNodes& nodes, const double* a, const double* z, double* x) {
  for (int i = first; i < last; ++i) {
    double* to = x + static_cast<std::ptrdiff_t>(width) * i;
    const std::ptrdiff_t from = 3 * static_cast<std::ptrdiff_t>(nodes.node[i]);
    store(to, load(a + from));
    if (i < nodes.turning) store(to + 3, load(z + from));
  }
}

// z = B r, w = (own) z of four nodes; returns z.
TIEFMU_INLINE Twist scale(int width, int q, const Twist& r, const SurfaceVectors& all, Simd4& rho, Simd4& energy) {
  const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(4 * width) * q;
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
  return z;
}

template <int width> TIEFMU_INLINE Sums startOf(int first, int last, bool along, const SurfaceVectors& all) {
  Simd4 rho = {}, energy = {}, size = {}, shared = {}, projection = {};
  for (int q = first; q < last; ++q) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(4 * width) * q;
    const double* block = all.block + static_cast<std::ptrdiff_t>(4 * nodeBlock::count) * q;
    const Twist r = loadTwist(all.residual + at, width), x = loadTwist(all.x + at, width);
    const Twist y = scale(width, q, r, all, rho, energy);
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
    const Simd4 own = dot(Twist{y.v + x.v, y.w + x.w}, Twist{b.v + r.v, b.w + r.w});
    size += own;
    shared += share * own;
    if (along)
      for (int k = 0; k < width; ++k)
        projection += lanes(all.residual + at + 4 * k) * lanes(all.direction + at + 4 * k);
  }
  return {sum(rho), sum(energy), sum(size), sum(shared), sum(projection)};
}

Sums start(int width, int first, int last, bool along, const SurfaceVectors& all) {
  return width == 6 ? startOf<6>(first, last, along, all) : startOf<3>(first, last, along, all);
}

double turn(int width, int first, int last, const SurfaceVectors& all) {
  Simd4 energy = {};
  for (std::ptrdiff_t k = static_cast<std::ptrdiff_t>(4 * width) * first;
       k < static_cast<std::ptrdiff_t>(4 * width) * last; k += 4) {
    const Simd4 p = lanes(all.direction + k), own = lanes(all.own + k) * p;
    put(all.scaled + k, p);
    put(all.product + k, own);
    energy += p * own;
  }
  return sum(energy);
}

template <int width, bool first>
TIEFMU_INLINE Sums advanceOf(int from, int to, double alpha, double beta, const SurfaceVectors& all) {
  Simd4 rho = {}, energy = {};
  const Simd4 a = same(alpha), b = same(beta);
  for (int q = from; q < to; ++q) {
    const std::ptrdiff_t begin = static_cast<std::ptrdiff_t>(4 * width) * q;
    for (int k = 0; k < width; ++k) {
      const std::ptrdiff_t at = begin + 4 * k;
      Simd4 p = lanes(all.scaled + at), s = lanes(all.product + at);
      if constexpr (!first) {
        p += b * lanes(all.direction + at);
        s += b * lanes(all.image + at);
      }
      put(all.direction + at, p);
      put(all.image + at, s);
      put(all.x + at, lanes(all.x + at) + a * p);
      put(all.residual + at, lanes(all.residual + at) - a * s);
    }
    scale(width, q, loadTwist(all.residual + begin, width), all, rho, energy);
  }
  return {sum(rho), sum(energy)};
}

Sums advance(int width, int first, int last, double alpha, double beta, const SurfaceVectors& all) {
  if (beta == 0)
    return width == 6 ? advanceOf<6, true>(first, last, alpha, beta, all)
                      : advanceOf<3, true>(first, last, alpha, beta, all);
  return width == 6 ? advanceOf<6, false>(first, last, alpha, beta, all)
                    : advanceOf<3, false>(first, last, alpha, beta, all);
}

}  // namespace
}  // namespace tiefmu
