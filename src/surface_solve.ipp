// The kernels of surface_solve.hpp, compiled in each build under its own flags. Nothing here may use a function that
// another build shares.
#include <utility>

#include "surface_nodes.ipp"

namespace tiefmu {
namespace {

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

// Place of the pair i, j among those of the upper triangle by rows.
template <int N> constexpr int shareOf(int i, int j) {
  return i <= j ? i * N - i * (i - 1) / 2 + j - i : shareOf<N>(j, i);
}

// One segment at a time: three numbers a corner are too few to be worth turning four segments side by side.
template <int N> TIEFMU_INLINE void shares(const SurfacePart& part, double* block) {
  for (int e = 0; e < part.count; ++e)
    for (int i = 0; i < N; ++i) {
      double* to = block + static_cast<std::ptrdiff_t>(nodeBlock::count) * part.corner[N * e + i];
      const double m = part.planes[static_cast<std::ptrdiff_t>(shareCount) * e + shareOf<N>(i, i)];
      to[nodeBlock::translation] += m;  // xx, yy, zz
      to[nodeBlock::translation + 3] += m;
      to[nodeBlock::translation + 5] += m;
    }
}

// sum m phi phi^T times v. Written out, which a compiler leaves a loop.
template <int N, int i, int... j>
TIEFMU_INLINE SimdVec3 rowOfShares(const double* share, const SimdVec3* v, std::integer_sequence<int, j...>) {
  return ((share[shareOf<N>(i, j)] * v[j]) + ...);
}
template <int N, int... i>
TIEFMU_INLINE void ofShares(const double* share, const SimdVec3* v, SimdVec3* to,
                            std::integer_sequence<int, i...> all) {
  ((to[i] = rowOfShares<N, i>(share, v, all)), ...);
}
template <int N> TIEFMU_INLINE void ofShares(const double* share, const SimdVec3* v, SimdVec3* to) {
  ofShares<N>(share, v, to, std::make_integer_sequence<int, N>{});
}
template <int N> TIEFMU_INLINE void gatherCorners(const int* node, int width, const double* field, SimdVec3* to) {
  for (int i = 0; i < N; ++i) to[i] = load(field + static_cast<std::ptrdiff_t>(width) * node[i]);
}
template <int N> TIEFMU_INLINE void scatterCorners(const int* node, int width, const SimdVec3* from, double* field) {
  for (int i = 0; i < N; ++i) {
    double* p = field + static_cast<std::ptrdiff_t>(width) * node[i];
    store(p, loadStored(p) + from[i]);
  }
}

template <int N> TIEFMU_INLINE void shapes(const SurfacePart& part, const SurfaceShape& shape, double* block) {
  using namespace shapePlane;
  const int* index = shape.index;
  for (int e = 0; e < part.count; ++e) {
    const int* corner = part.corner + 4 * N * e;
    Simd4 a[N] = {};
    Simd4Vec3 c[N] = {};
    Symmetric w[N] = {};
    for (int s = part.firstSlave[e]; s < part.firstSlave[e + 1]; ++s, index += 4) {
      double* plane = part.planes + static_cast<std::ptrdiff_t>(4 * count) * s;
      const Simd4 m = lanes(plane + 4 * mass), I = lanes(plane + 4 * inertia);
      const auto at = [&](int k) TIEFMU_INLINED { return shape.offset + 3 * static_cast<std::ptrdiff_t>(index[k]); };
      const Simd4Vec3 d = loadFour(at(0), at(1), at(2), at(3)), md = m * d;
      put3(plane + 4 * offset, d);
      Symmetric own = {};
      addInertia(m, d, own);
      own.xx += I;
      own.yy += I;
      own.zz += I;
      for (int i = 0; i < N; ++i) {
        const Simd4 phi = lanes(plane + 4 * (weight + i)), share = phi * phi;
        a[i] += share * m;
        c[i] += share * md;
        w[i].xx += share * own.xx;
        w[i].xy += share * own.xy;
        w[i].xz += share * own.xz;
        w[i].yy += share * own.yy;
        w[i].yz += share * own.yz;
        w[i].zz += share * own.zz;
      }
    }
    for (int i = 0; i < N; ++i) {
      const Simd4 zero = {};
      scatter(corner + 4 * i, nodeBlock::count, Symmetric{a[i], zero, zero, a[i], zero, a[i]}, block,
              nodeBlock::translation);
      scatter(corner + 4 * i, nodeBlock::count, c[i], block, nodeBlock::lever);
      scatter(corner + 4 * i, nodeBlock::count, w[i], block, nodeBlock::rotation);
    }
  }
}

TIEFMU_INLINE Simd4Vec3 loadSlaves(const double* field, const int* slave) {
  const auto at = [&](int k) TIEFMU_INLINED { return field + 3 * static_cast<std::ptrdiff_t>(slave[k]); };
  return loadFour(at(0), at(1), at(2), at(3));
}

template <int N>
TIEFMU_INLINE void leftByShares(const SurfacePart& part, const SegmentLoads& loads, const double* a, double* residual) {
  for (int e = 0; e < part.count; ++e) {
    SimdVec3 ai[N], f[N];
    gatherCorners<N>(part.node + N * e, 3, a, ai);
    ofShares<N>(part.planes + static_cast<std::ptrdiff_t>(shareCount) * e, ai, f);
    for (int i = 0; i < N; ++i) f[i] = -f[i];
    for (std::ptrdiff_t s = part.slave[2 * e]; s < part.slave[2 * e + 1]; ++s) {
      const SimdVec3 force = load(loads.slaveForce + 3 * s);
      for (int i = 0; i < N; ++i) f[i] += part.weight[N * s + i] * force;
    }
    scatterCorners<N>(part.corner + N * e, part.width, f, residual);
  }
}

template <int N>
TIEFMU_INLINE double leftByShapes(const SurfacePart& part, const double* offset, const SegmentLoads& loads,
                                  const double* a, const double* z, double* residual) {
  using namespace shapePlane;
  Simd4 fastest = {};
  for (int e = 0; e < part.count; ++e) {
    const int *corner = part.corner + 4 * N * e, *node = part.node + 4 * N * e;
    Simd4Vec3 ai[N], zi[N], wi[N] = {}, f[N] = {}, t[N] = {};
    for (int i = 0; i < N; ++i) {
      ai[i] = gather(node + 4 * i, 3, a, 0);
      zi[i] = gather(node + 4 * i, 3, z, 0);
      if (loads.velocity) wi[i] = gather(node + 4 * i, 3, loads.spin, 0);
    }
    for (int s = part.firstSlave[e]; s < part.firstSlave[e + 1]; ++s) {
      const double* plane = part.planes + static_cast<std::ptrdiff_t>(4 * count) * s;
      const int* slave = part.slave + static_cast<std::ptrdiff_t>(4) * s;
      Simd4 phi[N];
      for (int i = 0; i < N; ++i) phi[i] = lanes(plane + 4 * (weight + i));
      Simd4Vec3 as = phi[0] * ai[0], zs = phi[0] * zi[0];
      for (int i = 1; i < N; ++i) {
        as += phi[i] * ai[i];
        zs += phi[i] * zi[i];
      }
      const Simd4Vec3 d = loadSlaves(offset, slave);
      as += cross(zs, d);
      if (loads.velocity) {
        Simd4Vec3 w = phi[0] * wi[0];
        for (int i = 1; i < N; ++i) w += phi[i] * wi[i];
        const Simd4 w2 = dot(w, w);
        fastest = w2 > fastest ? w2 : fastest;
        as += cross(w, cross(w, d));
      }
      const Simd4Vec3 force = loadSlaves(loads.slaveForce, slave) - lanes(plane + 4 * mass) * as;
      const Simd4Vec3 moment = loadSlaves(loads.slaveMoment, slave) - lanes(plane + 4 * inertia) * zs + cross(d, force);
      for (int i = 0; i < N; ++i) {
        f[i] += phi[i] * force;
        t[i] += phi[i] * moment;
      }
    }
    for (int i = 0; i < N; ++i) {
      scatter(corner + 4 * i, part.width, f[i], residual, 0);
      scatter(corner + 4 * i, part.width, t[i], residual, 3);
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
  for (int e = 0; e < part.count; ++e) {
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

template <int N, int width> TIEFMU_INLINE double timesShares(const SurfacePart& part, const double* in, double* out) {
  SimdVec3 energy = {};
  for (int e = 0; e < part.count; ++e) {
    SimdVec3 v[N], f[N];
    gatherCorners<N>(part.corner + N * e, width, in, v);
    ofShares<N>(part.planes + static_cast<std::ptrdiff_t>(shareCount) * e, v, f);
    for (int i = 0; i < N; ++i) energy += f[i] * v[i];
    scatterCorners<N>(part.corner + N * e, width, f, out);
  }
  return energy[0] + energy[1] + energy[2];
}

template <int N> TIEFMU_INLINE double timesShapes(const SurfacePart& part, const double* in, double* out) {
  using namespace shapePlane;
  constexpr int width = 6;
  Simd4 energy = {};
  for (int e = 0; e < part.count; ++e) {
    const int* corner = part.corner + 4 * N * e;
    Simd4Vec3 v[N], w[N], f[N] = {}, t[N] = {};
    for (int i = 0; i < N; ++i) {
      v[i] = gather(corner + 4 * i, width, in, 0);
      w[i] = gather(corner + 4 * i, width, in, 3);
    }
    for (int s = part.firstSlave[e]; s < part.firstSlave[e + 1]; ++s) {
      const double* plane = part.planes + static_cast<std::ptrdiff_t>(4 * count) * s;
      Simd4 phi[N];
      for (int i = 0; i < N; ++i) phi[i] = lanes(plane + 4 * (weight + i));
      Simd4Vec3 vs = phi[0] * v[0], ws = phi[0] * w[0];
      for (int i = 1; i < N; ++i) {
        vs += phi[i] * v[i];
        ws += phi[i] * w[i];
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
      scatter(corner + 4 * i, width, t[i], out, 3);
    }
  }
  return sum(energy);
}

// With V = (a, w) of the centre, K V for the corners' v_i: a = sum v_i / n, w = Ibar^-1 sum r_i x v_i.
template <int N> TIEFMU_INLINE void mean(const SurfacePart& part, const SurfaceShape& shape, double* block) {
  using namespace meanPlane;
  constexpr double share = 1.0 / N;
  for (int e = 0; e < part.count; ++e) {
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
  for (int e = 0; e < part.count; ++e) {
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

void prepareShares(const SurfacePart& part, double* block) {
  part.corners == 4 ? shares<4>(part, block) : shares<3>(part, block);
}
void prepareShapes(const SurfacePart& part, const SurfaceShape& shape, double* block) {
  part.corners == 4 ? shapes<4>(part, shape, block) : shapes<3>(part, shape, block);
}
void prepareMean(const SurfacePart& part, const SurfaceShape& shape, double* block) {
  part.corners == 4 ? mean<4>(part, shape, block) : mean<3>(part, shape, block);
}
double leaveShares(const SurfacePart& part, const SegmentLoads& loads, const double* a, double* residual) {
  part.corners == 4 ? leftByShares<4>(part, loads, a, residual) : leftByShares<3>(part, loads, a, residual);
  return 0;
}
double leaveShapes(const SurfacePart& part, const double* offset, const SegmentLoads& loads, const double* a,
                   const double* z, double* residual) {
  return part.corners == 4 ? leftByShapes<4>(part, offset, loads, a, z, residual)
                           : leftByShapes<3>(part, offset, loads, a, z, residual);
}
double leaveMean(const SurfacePart& part, const double* offset, const SegmentLoads& loads, const double* a,
                 double* residual) {
  return part.corners == 4 ? leftByMean<4>(part, offset, loads, a, residual)
                           : leftByMean<3>(part, offset, loads, a, residual);
}
double multiplyShares(const SurfacePart& part, const double* in, double* out) {
  if (part.corners == 4) return part.width == 6 ? timesShares<4, 6>(part, in, out) : timesShares<4, 3>(part, in, out);
  return part.width == 6 ? timesShares<3, 6>(part, in, out) : timesShares<3, 3>(part, in, out);
}
double multiplyShapes(const SurfacePart& part, const double* in, double* out) {
  return part.corners == 4 ? timesShapes<4>(part, in, out) : timesShapes<3>(part, in, out);
}
double multiplyMean(const SurfacePart& part, const double* in, double* out) {
  return part.corners == 4 ? timesMean<4>(part, in, out) : timesMean<3>(part, in, out);
}

}  // namespace

const SurfaceKernels TIEFMU_SURFACE_KERNELS = {
    leaveShares,  leaveShapes, leaveMean, prepareShares, prepareShapes, prepareMean, multiplyShares, multiplyShapes,
    multiplyMean, invert,      begin,     give,          take,          start,       turn,           advance};

}  // namespace tiefmu
