// The kernels of segment_solve.hpp, compiled in each build under its own flags. Nothing here may use a function that
// another build shares.
#include <type_traits>

#include "lanes.ipp"

namespace tiefmu {
namespace {

template <class Body> TIEFMU_INLINE double byShape(const TieView& tie, const SegmentList& list, Body body) {
  using std::integral_constant;
  if (tie.corners == 4)
    return list.mixed ? body(integral_constant<int, 4>{}, std::true_type{})
                      : body(integral_constant<int, 4>{}, std::false_type{});
  return list.mixed ? body(integral_constant<int, 3>{}, std::true_type{})
                    : body(integral_constant<int, 3>{}, std::false_type{});
}

template <int N, bool mixed>
TIEFMU_INLINE void solveTranslation(const TieView& tie, const SegmentList& list, const SegmentLoads& loads, double* a) {
  using namespace translationPlane;
  const double* weight = tie.weight - N * tie.firstSlave;
  for (int p = 0; p < list.count; p += 4) {
    const Four<N, mixed> four(tie, list, p, count);
    Simd4Vec3 y[N];
    for (int i = 0; i < N; ++i) {
      y[i] = four.gather(loads.nodeForce, i);
    }
    if (loads.slaveForce) {
      Simd4Vec3 sum[N] = {};
      const Slaves slaves(tie, four);
      for (int s = 0; s < slaves.most; ++s) {
        Simd4 phi[N];
        const double* at[4];
        for (int k = 0; k < 4; ++k) at[k] = weight + N * slaves.at(k, s);
        transposed<N>(at, phi);
        Simd4Vec3 force = slaves.load3(loads.slaveForce, s);
        if (!slaves.all(s)) force = slaves.there(s) * force;
        for (int i = 0; i < N; ++i) sum[i] += phi[i] * force;
      }
      for (int i = 0; i < N; ++i) y[i] += sum[i];
    }
    if constexpr (mixed)
      for (int i = 0; i < N; ++i) y[i] = four.held(loads.known, four.isFixed(i) == 1, a, i, y[i]);
    for (int i = 0; i < N; ++i) {
      Simd4Vec3 ai = four.plane(matrix + 4 * i) * y[0];
      for (int j = 1; j < N; ++j) ai += four.plane(matrix + 4 * i + j) * y[j];
      four.scatter(ai, a, i);
    }
  }
}

double translation(const TieView& tie, TieGeometry, const SegmentList& list, const SegmentLoads& loads, double* a,
                   double*) {
  return byShape(tie, list, [&](auto n, auto mixed) TIEFMU_INLINED {
    solveTranslation<decltype(n)::value, decltype(mixed)::value>(tie, list, loads, a);
    return 0.0;
  });
}

template <int N, bool mixed>
TIEFMU_INLINE double solvePair(const TieView& tie, const double* offset, const SegmentList& list,
                               const SegmentLoads& loads, double* a, double* z) {
  using namespace pairPlane;
  Simd4 fastest = {};
  for (int p = 0; p < list.count; p += 4) {
    const Four<N, mixed> four(tie, list, p, count);
    const Slaves slaves(tie, four);
    const Simd4Vec3 d = slaves.load3(offset, 0);
    Simd4Vec3 ai[N], zi[N], a0 = {}, z0 = {};
    for (int i = 0; i < N; ++i) {
      ai[i] = four.alone(loads.nodeForce, a, loads.known, four.plane(inverseMass + i), i);
      zi[i] = four.alone(loads.nodeMoment, z, loads.known, four.plane(inverseInertia + i), i);
      a0 += four.plane(weight + i) * ai[i];
      z0 += four.plane(weight + i) * zi[i];
    }
    Simd4Vec3 acceleration = a0, force = {}, moment = {};
    if (loads.velocity) {
      Simd4Vec3 w = {};
      for (int i = 0; i < N; ++i) w += four.plane(weight + i) * four.gather(loads.spin, i);
      const Simd4 w2 = dot(w, w);
      fastest = w2 > fastest ? w2 : fastest;
      acceleration += cross(w, cross(w, d));
    }
    if (loads.slaveForce) {
      force = slaves.load3(loads.slaveForce, 0);
      moment = slaves.load3(loads.slaveMoment, 0);
    }
    const Simd4Vec3 held = four.plane(k) * force - four.plane(km) * acceleration;
    const Simd4Vec3 h = z0 + four.plane(sJ) * (moment + cross(d, held));
    const Simd4Vec3 turn = four.plane(whole) * (h + (four.plane(twist) * dot(d, h)) * d);
    const Simd4Vec3 R = held - four.plane(km) * cross(turn, d), Q = four.plane(inverseSJ) * (turn - z0);
    for (int i = 0; i < N; ++i) {
      four.scatter(ai[i] + (four.plane(inverseMass + i) * four.plane(weight + i)) * R, a, i);
      four.scatter(zi[i] + (four.plane(inverseInertia + i) * four.plane(weight + i)) * Q, z, i);
    }
  }
  return largest(fastest);
}

double pair(const TieView& tie, TieGeometry geometry, const SegmentList& list, const SegmentLoads& loads, double* a,
            double* z) {
  return byShape(tie, list, [&](auto n, auto mixed) TIEFMU_INLINED {
    return solvePair<decltype(n)::value, decltype(mixed)::value>(tie, geometry.offset, list, loads, a, z);
  });
}

// Place of the pair i, j among those of the upper triangle by rows.
template <int N> constexpr int pairOf(int i, int j) {
  return i <= j ? i * N - i * (i - 1) / 2 + j - i : pairOf<N>(j, i);
}

// body(k) for k in [first, end) and body(i, j) for 0 <= i <= j < N: as types, so that no place is reckoned at run time.
template <int first, int end, class Body> TIEFMU_INLINE void each(Body body) {
  if constexpr (first < end) {
    body(std::integral_constant<int, first>{});
    each<first + 1, end>(body);
  }
}
template <int N, class Body> TIEFMU_INLINE void eachPair(Body body) {
  each<0, N>([&](auto i) TIEFMU_INLINED { each<decltype(i)::value, N>([&](auto j) TIEFMU_INLINED { body(i, j); }); });
}

template <int N, bool mixed>
TIEFMU_INLINE double solveMany(const TieView& tie, const double* offset, const SegmentList& list,
                               const SegmentLoads& loads, double* a, double* z) {
  using namespace manyPlane;
  constexpr int pairs = N * (N + 1) / 2, size = 3 * N;
  const double* weight = tie.weight - N * tie.firstSlave;
  Simd4 fastest = {};
  for (int p = 0; p < list.count; p += 4) {
    const Four<N, mixed> four(tie, list, p, count);
    const Slaves slaves(tie, four);
    Simd4Vec3 f[N], t[N], c[pairs] = {}, wi[N], ka[N], kz[N];
    Symmetric y[pairs] = {};
    for (int i = 0; i < N; ++i) {
      f[i] = four.gather(loads.nodeForce, i);
      t[i] = four.gather(loads.nodeMoment, i);
      if (loads.velocity) wi[i] = four.gather(loads.spin, i);
      if constexpr (mixed) {
        const auto fixed = four.plane(manyPlane::free + i) == 0;
        ka[i] = four.held(loads.known, fixed, a, i, Simd4Vec3{});
        kz[i] = four.held(loads.known, fixed, z, i, Simd4Vec3{});
      }
    }
    for (int s = 0; s < slaves.most; ++s) {
      Simd4 phi[N];
      const double* at[4];
      for (int k = 0; k < 4; ++k) at[k] = weight + N * slaves.at(k, s);
      transposed<N>(at, phi);
      Simd4 m = slaves.load1(loads.slaveMass, s), inertiaOfSlave = slaves.load1(loads.slaveInertia, s);
      const Simd4Vec3 d = slaves.load3(offset, s);
      Simd4Vec3 force = {}, moment = {};
      if (loads.slaveForce) {
        force = slaves.load3(loads.slaveForce, s);
        moment = slaves.load3(loads.slaveMoment, s);
      }
      if (!slaves.all(s)) {
        const Simd4 there = slaves.there(s);
        m *= there;
        inertiaOfSlave *= there;
        force = there * force;
        moment = there * moment;
      }
      const Simd4Vec3 md = m * d;
      if (loads.velocity) {
        Simd4Vec3 w = phi[0] * wi[0];
        for (int i = 1; i < N; ++i) w += phi[i] * wi[i];
        const Simd4 w2 = dot(w, w);
        fastest = w2 > fastest ? w2 : fastest;
        force -= cross(w, cross(w, md));
      }
      if constexpr (mixed) {
        Simd4Vec3 known = {}, knownTurn = {};
        for (int i = 0; i < N; ++i) {
          known += phi[i] * ka[i];
          knownTurn += phi[i] * kz[i];
          phi[i] *= four.plane(manyPlane::free + i);
        }
        force -= m * known + cross(knownTurn, md);
        moment -= inertiaOfSlave * knownTurn;
      }
      moment += cross(d, force);
      for (int i = 0; i < N; ++i) {
        f[i] += phi[i] * force;
        t[i] += phi[i] * moment;
      }
      Symmetric w = {};
      addInertia(m, d, w);
      w.xx += inertiaOfSlave;
      w.yy += inertiaOfSlave;
      w.zz += inertiaOfSlave;
      eachPair<N>([&](auto i, auto j) TIEFMU_INLINED {
        constexpr int ij = pairOf<N>(i, j);
        const Simd4 share = phi[i] * phi[j];
        c[ij] += share * md;
        y[ij].xx += share * w.xx;
        y[ij].xy += share * w.xy;
        y[ij].xz += share * w.xz;
        y[ij].yy += share * w.yy;
        y[ij].yz += share * w.yz;
        y[ij].zz += share * w.zz;
      });
    }
    const auto inverseOf = [&](int i, int j) TIEFMU_INLINED { return four.plane(manyPlane::inverse + 4 * i + j); };
    // The translations eliminated: S alpha = t - sum c x (A^-1 f).
    Simd4Vec3 u[N];
    for (int i = 0; i < N; ++i) {
      u[i] = inverseOf(i, 0) * f[0];
      for (int j = 1; j < N; ++j) u[i] += inverseOf(i, j) * f[j];
    }
    Simd4 s[size][size], x[size];
    each<0, N>([&](auto i) TIEFMU_INLINED {
      Simd4Vec3 e[N], right = t[i];  // e: (A^-1 c)_ri
      each<0, N>([&](auto r) TIEFMU_INLINED {
        e[r] = inverseOf(r, 0) * c[pairOf<N>(0, i)];
        each<1, N>([&](auto q) TIEFMU_INLINED { e[r] += inverseOf(r, q) * c[pairOf<N>(q, i)]; });
        right -= cross(c[pairOf<N>(i, r)], u[r]);
      });
      x[3 * i] = right.x;
      x[3 * i + 1] = right.y;
      x[3 * i + 2] = right.z;
      each<decltype(i)::value, N>([&](auto j) TIEFMU_INLINED {
        const Symmetric& own = y[pairOf<N>(i, j)];
        Simd4 trace = {}, m[3][3] = {};  // sum c_rj e_ri^T
        each<0, N>([&](auto r) TIEFMU_INLINED {
          const Simd4Vec3& cr = c[pairOf<N>(r, j)];
          trace += dot(e[r], cr);
          m[0][0] += cr.x * e[r].x;
          m[0][1] += cr.x * e[r].y;
          m[0][2] += cr.x * e[r].z;
          m[1][0] += cr.y * e[r].x;
          m[1][1] += cr.y * e[r].y;
          m[1][2] += cr.y * e[r].z;
          m[2][0] += cr.z * e[r].x;
          m[2][1] += cr.z * e[r].y;
          m[2][2] += cr.z * e[r].z;
        });
        const Simd4 add = i == j ? four.plane(manyPlane::inertia + i) - trace : -trace;
        const int at = 3 * i, to = 3 * j;
        // Block i, j of S goes below the diagonal transposed.
        s[to][at] = own.xx + m[0][0] + add;
        s[to + 1][at] = own.xy + m[0][1];
        s[to + 2][at] = own.xz + m[0][2];
        s[to][at + 1] = own.xy + m[1][0];
        s[to + 1][at + 1] = own.yy + m[1][1] + add;
        s[to + 2][at + 1] = own.yz + m[1][2];
        s[to][at + 2] = own.xz + m[2][0];
        s[to + 1][at + 2] = own.yz + m[2][1];
        s[to + 2][at + 2] = own.zz + m[2][2] + add;
      });
    });
    // L D L^T in place, x along with it.
    Simd4 inversePivot[size];
    each<0, size>([&](auto k) TIEFMU_INLINED {
      inversePivot[k] = 1.0 / s[k][k];
      each<decltype(k)::value + 1, size>([&](auto i) TIEFMU_INLINED {
        const Simd4 l = s[i][k] * inversePivot[k];
        each<decltype(k)::value + 1, decltype(i)::value + 1>([&](auto j) TIEFMU_INLINED { s[i][j] -= l * s[j][k]; });
        x[i] -= l * x[k];
      });
    });
    for (int k = size; k-- > 0;) {
      Simd4 sum = x[k];
      for (int i = k + 1; i < size; ++i) sum -= s[i][k] * x[i];
      x[k] = inversePivot[k] * sum;
    }
    Simd4Vec3 turn[N], g[N];
    for (int i = 0; i < N; ++i) turn[i] = {x[3 * i], x[3 * i + 1], x[3 * i + 2]};
    each<0, N>([&](auto i) TIEFMU_INLINED {
      g[i] = cross(turn[0], c[pairOf<N>(i, 0)]);
      each<1, N>([&](auto j) TIEFMU_INLINED { g[i] += cross(turn[j], c[pairOf<N>(i, j)]); });
    });
    for (int i = 0; i < N; ++i) {
      Simd4Vec3 ai = u[i];
      for (int j = 0; j < N; ++j) ai -= inverseOf(i, j) * g[j];
      four.scatter(ai, a, i);
      four.scatter(turn[i], z, i);
    }
  }
  return largest(fastest);
}

double many(const TieView& tie, TieGeometry geometry, const SegmentList& list, const SegmentLoads& loads, double* a,
            double* z) {
  return byShape(tie, list, [&](auto n, auto mixed) TIEFMU_INLINED {
    return solveMany<decltype(n)::value, decltype(mixed)::value>(tie, geometry.offset, list, loads, a, z);
  });
}

// Unknowns: acceleration of the centre and angular acceleration, V. With K = diag(n 1, Ibar), the rigid motions of the
// corners R and N = R^T M^-1 R: (K N^-1 K + G) V = K N^-1 y + W, where y = K V without slaves, W the slaves' loads
// less their bias and G their mass matrix. About the centre weighted by 1/m, c, N is diagonal but for one block, B^-1.
template <int N, bool mixed>
TIEFMU_INLINE double solveBody(const TieView& tie, TieGeometry geometry, const SegmentList& list,
                               const SegmentLoads& loads, double* a) {
  using namespace bodyPlane;
  constexpr double n = N;
  Simd4 fastest = {};
  for (int p = 0; p < list.count; p += 4) {
    const Four<N, mixed> four(tie, list, p, count);
    const SegmentFrame* frame[4];
    for (int k = 0; k < 4; ++k) frame[k] = geometry.frame + four.segment[k];
    Simd4Vec3 r[N], ai[N], c = {}, y1 = {}, y2 = {};
    for (int i = 0; i < N; ++i) {
      r[i] = loadFour(frame[0]->arm + 3 * i, frame[1]->arm + 3 * i, frame[2]->arm + 3 * i, frame[3]->arm + 3 * i);
      const Simd4 inverseMassOf = four.plane(inverseMass + i);
      ai[i] = four.alone(loads.nodeForce, a, loads.known, inverseMassOf, i);
      c += inverseMassOf * r[i];
      y1 += ai[i];
      y2 += cross(r[i], ai[i]);
    }
    c = four.plane(s) * c;
    Symmetric ibar = {}, b = {};
    for (int i = 0; i < N; ++i) {
      addInertia(Simd4{1, 1, 1, 1}, r[i], ibar);
      addInertia(four.plane(inverseMass + i), r[i] - c, b);
    }
    b = inverse(b);
    // The slaves' body as it stands now.
    const Simd4 m = four.plane(mass);
    Simd4Vec3 S = four.plane3(moment);
    Symmetric J = {four.plane(inertia),     four.plane(inertia + 1), four.plane(inertia + 2),
                   four.plane(inertia + 3), four.plane(inertia + 4), four.plane(inertia + 5)};
    if (loads.rotation) {
      const double* at[4];
      for (int k = 0; k < 4; ++k) at[k] = loads.rotation + 4 * static_cast<std::ptrdiff_t>(four.segment[k]);
      turnBody(at, S, J);
    }
    Simd4Vec3 w1 = {}, w2 = {};
    if (loads.slaveForce) {
      const Slaves slaves(tie, four);
      for (int k = 0; k < slaves.most; ++k) {
        Simd4Vec3 force = slaves.load3(loads.slaveForce, k);
        Simd4Vec3 about = slaves.load3(loads.slaveMoment, k) + cross(slaves.load3(geometry.offset, k), force);
        if (!slaves.all(k)) {
          const Simd4 there = slaves.there(k);
          force = there * force;
          about = there * about;
        }
        w1 += force;
        w2 += about;
      }
    }
    if (loads.velocity) {
      Simd4Vec3 momentum = {}, v[N];
      for (int i = 0; i < N; ++i) {
        v[i] = four.gather(loads.velocity, i);
        momentum += cross(r[i], v[i]);
      }
      Symmetric inverseIbar;
      {
        const auto column = [&](int k) TIEFMU_INLINED {
          return loadFour(frame[0]->inverse + 3 * k, frame[1]->inverse + 3 * k, frame[2]->inverse + 3 * k,
                          frame[3]->inverse + 3 * k);
        };
        const Simd4Vec3 first = column(0), second = column(1), third = column(2);
        inverseIbar = {first.x, first.y, first.z, second.y, second.z, third.z};
      }
      const Simd4Vec3 w = inverseIbar * momentum;
      const Simd4 w2now = dot(w, w);
      fastest = w2now > fastest ? w2now : fastest;
      // -(dIbar/dt) w = w x L - 2 sum r x (w x r')
      Simd4 stretch = {};
      Simd4Vec3 shear = {};
      for (int i = 0; i < N; ++i) {
        stretch += dot(r[i], v[i]);
        shear += dot(r[i], w) * v[i];
      }
      y2 += cross(w, momentum) + 2.0 * (shear - stretch * w);
      w1 -= cross(w, cross(w, S));
      w2 -= cross(w, J * w);
    }
    // K N^-1 K + G and its right side
    const Simd4 ss = four.plane(s);
    const Simd4Vec3 b2 = b * (y2 - cross(c, y1)), b1 = ss * y1 + cross(c, b2);
    const Simd4Vec3 right1 = n * b1 + w1, right2 = ibar * b2 + w2;
    const Matrix bi = b * ibar;
    Matrix a12 = {n * cross(c, bi.x), n * cross(c, bi.y), n * cross(c, bi.z)};
    a12.x.y -= S.z;
    a12.x.z += S.y;
    a12.y.x += S.z;
    a12.y.z -= S.x;
    a12.z.x -= S.y;
    a12.z.y += S.x;
    const Simd4 zero = {};
    // [c]^T B [c] = -[c] (B [c]), columns of [c]: c x e
    const Simd4Vec3 cx = {zero, c.z, -c.y}, cy = {-c.z, zero, c.x}, cz = {c.y, -c.x, zero};
    const Simd4Vec3 tx = b * cx, ty = b * cy, tz = b * cz;
    constexpr double n2 = n * n;
    const Simd4 diagonal = n2 * ss + m;
    Symmetric a11 = {diagonal + n2 * dot(cx, tx), n2 * dot(cx, ty), n2 * dot(cx, tz),
                     diagonal + n2 * dot(cy, ty), n2 * dot(cy, tz), diagonal + n2 * dot(cz, tz)};
    const Simd4Vec3 ix = {ibar.xx, ibar.xy, ibar.xz}, iy = {ibar.xy, ibar.yy, ibar.yz},
                    iz = {ibar.xz, ibar.yz, ibar.zz};
    const Symmetric h = inverse({J.xx + dot(ix, bi.x), J.xy + dot(ix, bi.y), J.xz + dot(ix, bi.z), J.yy + dot(iy, bi.y),
                                 J.yz + dot(iy, bi.z), J.zz + dot(iz, bi.z)});
    const Matrix a12h = a12 * h;
    const Symmetric down = timesTransposed(a12h, a12);
    const Symmetric schur = {a11.xx - down.xx, a11.xy - down.xy, a11.xz - down.xz,
                             a11.yy - down.yy, a11.yz - down.yz, a11.zz - down.zz};
    const Simd4Vec3 v1 = inverse(schur) * (right1 - a12h * right2);
    const Simd4Vec3 v2 = h * (right2 - transposedTimes(a12, v1));
    // What the slaves add to the corners: M^-1 R N^-1 (K V - y)
    const Simd4Vec3 p1 = n * v1 - y1, p2 = ibar * v2 - y2;
    const Simd4Vec3 u2 = b * (p2 - cross(c, p1)), u1 = ss * p1 + cross(c, u2);
    for (int i = 0; i < N; ++i) four.scatter(ai[i] + four.plane(inverseMass + i) * (u1 + cross(u2, r[i])), a, i);
  }
  return largest(fastest);
}

double body(const TieView& tie, TieGeometry geometry, const SegmentList& list, const SegmentLoads& loads, double* a,
            double*) {
  return byShape(tie, list, [&](auto n, auto mixed) TIEFMU_INLINED {
    return solveBody<decltype(n)::value, decltype(mixed)::value>(tie, geometry, list, loads, a);
  });
}

}  // namespace

const SegmentKernels TIEFMU_SEGMENT_KERNELS = {translation, pair, many, body};

}  // namespace tiefmu
