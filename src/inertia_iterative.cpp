#include "inertia_iterative.hpp"

#include <algorithm>
#include <utility>

namespace tiefmu {
namespace {

constexpr int maxIterations = 400;

// Symmetric 3x3 matrices as xx xy xz yy yz zz.
Mat3 symmetric(const double* w) {
  Mat3 m;
  m << w[0], w[1], w[2], w[1], w[3], w[4], w[2], w[4], w[5];
  return m;
}
[[gnu::always_inline]] inline Vec3 timesSymmetric(const double* w, const Vec3& x) {
  return {w[0] * x.x() + w[1] * x.y() + w[2] * x.z(), w[1] * x.x() + w[3] * x.y() + w[4] * x.z(),
          w[2] * x.x() + w[4] * x.y() + w[5] * x.z()};
}

// The inverse by L D L^T; false where a pivot is lost in rounding.
bool invert(const Mat3& m, double* inverse) {
  const double p0 = m(0, 0), l10 = m(1, 0) / p0, l20 = m(2, 0) / p0;
  const double p1 = m(1, 1) - l10 * m(1, 0), l21 = (m(2, 1) - l20 * m(1, 0)) / p1;
  const double p2 = m(2, 2) - l20 * m(2, 0) - l21 * l21 * p1;
  constexpr double lost = 1e-13;
  if (!(p0 > 0) || !(p1 > lost * m(1, 1)) || !(p2 > lost * m(2, 2))) return false;
  const double d0 = 1 / p0, d1 = 1 / p1, d2 = 1 / p2, m20 = l10 * l21 - l20;  // of L^-1: -l10, m20, -l21
  inverse[5] = d2;
  inverse[4] = -l21 * d2;
  inverse[3] = d1 - l21 * inverse[4];
  inverse[2] = m20 * d2;
  inverse[1] = -l10 * d1 - l21 * inverse[2];
  inverse[0] = d0 - l10 * (-l10 * d1) + m20 * inverse[2];
  return true;
}

// Two nodes' part of the matrix, 6x6 (or 3x3 where nothing rotates), as numbers in a row:
//   [ A  -[c] ]    A: `vv` numbers, 1 (A = a 1, what the default formulation gives) or 9 (column by column);
//   [[c]   W  ]    c: 3; W symmetric: xx xy xz yy yz zz
template <int vv, bool turns> struct Block {
  static constexpr int size = vv + (turns ? 9 : 0), width = turns ? 6 : 3;
  using Vector = Eigen::Matrix<double, width, 1>;
  using Map = Eigen::Map<Vector>;
  using ConstMap = Eigen::Map<const Vector>;

  template <bool transposed> [[gnu::always_inline]] static Vec3 translation(const double* b, const Vec3& x) {
    if constexpr (vv == 1)
      return b[0] * x;
    else if constexpr (transposed)
      return Eigen::Map<const Mat3>(b).transpose() * x;
    else
      return Eigen::Map<const Mat3>(b) * x;
  }
  // B x, or B^T x: the parts that rotate are symmetric as a whole.
  template <bool transposed> [[gnu::always_inline]] static Vector times(const double* b, const Vector& x) {
    if constexpr (!turns) {
      return translation<transposed>(b, x);
    } else {
      const double *c = b + vv, *w = b + vv + 3;
      const Vec3 v = x.template head<3>(), r = x.template tail<3>(), t = translation<transposed>(b, v);
      Vector y;
      y << t.x() - c[1] * r.z() + c[2] * r.y(), t.y() - c[2] * r.x() + c[0] * r.z(),
          t.z() - c[0] * r.y() + c[1] * r.x(), c[1] * v.z() - c[2] * v.y() + w[0] * r.x() + w[1] * r.y() + w[2] * r.z(),
          c[2] * v.x() - c[0] * v.z() + w[1] * r.x() + w[3] * r.y() + w[4] * r.z(),
          c[0] * v.y() - c[1] * v.x() + w[2] * r.x() + w[4] * r.y() + w[5] * r.z();
      return y;
    }
  }
};

template <int vv, bool turns> class Iterative : public ConsistentInertia {
  using B = Block<vv, turns>;
  using Vector = typename B::Vector;
  static constexpr int width = B::width;

 public:
  explicit Iterative(const Model& model) : ConsistentInertia(model) {
    order();
    findPattern();
    const std::size_t n = static_cast<std::size_t>(free_);
    value_.resize(B::size * column_.size());
    diagonal_.resize(B::size * n);
    inverse_.resize(n);
    for (auto* v : {&x_, &rhs_, &residual_, &direction_, &image_, &scaled_, &sweep_}) v->resize(width * n);
  }

  void update(const double* nodeMass, const double* nodeInertia, const double* slaveMass, const double* slaveInertia,
              const double* offset, const std::vector<SegmentFrame>& frames) override {
    std::fill(value_.begin(), value_.end(), 0.0);
    std::fill(diagonal_.begin(), diagonal_.end(), 0.0);
    for (int i = 0; i < free_; ++i) {
      double* b = &diagonal_[B::size * static_cast<std::size_t>(place_[i])];
      const int node = model_.freeBegin() + i;
      if constexpr (vv == 1)
        b[0] = nodeMass[node];
      else
        b[0] = b[4] = b[8] = nodeMass[node];
      if constexpr (turns) b[vv + 3] = b[vv + 6] = b[vv + 8] = i < freeRotating_ ? nodeInertia[node] : 1;
    }
    std::size_t frame = 0;
    for (std::size_t g = 0; g < model_.groups.size(); ++g) {
      const TieGroup& group = model_.groups[g];
      if (group.coupling == Coupling::meanMotion) {
        if constexpr (vv == 9) addMeanMotion(group, slots_[g], slaveMass, slaveInertia, offset, frames.data() + frame);
        frame += static_cast<std::size_t>(group.segments());
      } else {
        addShapes(group, slots_[g], slaveMass, slaveInertia, offset);
      }
    }
    for (int p = 0; p < free_; ++p) {
      const double* b = &diagonal_[B::size * static_cast<std::size_t>(p)];
      Inverse& inverse = inverse_[p];
      Mat3 a = Mat3::Identity();
      if constexpr (vv == 1)
        a *= b[0];
      else
        a = Eigen::Map<const Mat3>(b);
      if (!invert(a, inverse.translation)) refuse(nodeAt(p), false);
      if constexpr (turns) {
        const Mat3 c = skew(Vec3(b[vv], b[vv + 1], b[vv + 2]));
        const Mat3 schur = symmetric(b + vv + 3) + c * symmetric(inverse.translation) * c;
        if (!invert(schur, inverse.rotation)) refuse(nodeAt(p), true);
      }
    }
  }

  void solve(const double* force, const double* moment, double* a, double* z) override {
    for (int i = 0; i < free_; ++i) {
      const std::size_t p = static_cast<std::size_t>(width) * static_cast<std::size_t>(place_[i]);
      at(&rhs_[p], 0) = at(force, i);
      at(&x_[p], 0) = at(a, i);
      if constexpr (turns) {
        at(&rhs_[p + 3], 0) = i < freeRotating_ ? Vec3(at(moment, i)) : Vec3(0, 0, 0);
        at(&x_[p + 3], 0) = i < freeRotating_ ? Vec3(at(z, i)) : Vec3(0, 0, 0);
      }
    }
    conjugateGradients();
    for (int i = 0; i < free_; ++i) {
      const std::size_t p = static_cast<std::size_t>(width) * static_cast<std::size_t>(place_[i]);
      at(a, i) = at(&x_[p], 0);
      if constexpr (turns)
        if (i < freeRotating_) at(z, i) = at(&x_[p + 3], 0);
    }
  }

 private:
  struct Inverse {                       // of a diagonal block: A^-1, and that of W - [c]^T A^-1 [c]
    double translation[6], rotation[6];  // xx xy xz yy yz zz
  };
  // A slot: -1 where a corner is not free; -2 - p on the diagonal; else 2 * block + transposed.

  int nodeAt(int place) const {
    return static_cast<int>(std::find(place_.begin(), place_.end(), place) - place_.begin());
  }

  int freeCorner(const TieGroup& group, int e, int corner) const {
    const int i = group.node[static_cast<std::size_t>(group.corners) * e + corner] - model_.freeBegin();
    return i >= 0 && i < free_ ? i : -1;
  }

  // Pairs of different free nodes that share a segment, each once from either side, sorted.
  std::vector<std::pair<int, int>> neighbours() const {
    std::vector<std::pair<int, int>> pairs;
    for (const TieGroup& group : model_.groups)
      for (int e = 0; e < group.segments(); ++e)
        for (int p = 0; p < group.corners; ++p)
          for (int q = 0; q < group.corners; ++q) {
            const int a = freeCorner(group, e, p), b = freeCorner(group, e, q);
            if (a >= 0 && b >= 0 && a != b) pairs.emplace_back(a, b);
          }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return pairs;
  }

  // Breadth first through the mesh, so that what a sweep needs is near in memory whatever the ids.
  void order() {
    const auto pairs = neighbours();
    std::vector<int> begin(free_ + 1, 0), queue;
    for (const auto& [a, b] : pairs) ++begin[a + 1];
    for (int i = 0; i < free_; ++i) begin[i + 1] += begin[i];
    place_.assign(free_, -1);
    queue.reserve(free_);
    const auto reach = [&](int i) {
      if (place_[i] >= 0) return;
      place_[i] = static_cast<int>(queue.size());
      queue.push_back(i);
    };
    std::size_t next = 0;
    for (int start = 0; start < free_; ++start)
      for (reach(start); next < queue.size(); ++next)
        for (int k = begin[queue[next]]; k < begin[queue[next] + 1]; ++k) reach(pairs[k].second);
  }

  void findPattern() {
    std::vector<std::pair<int, int>> pairs = neighbours();
    for (auto& [a, b] : pairs) {
      a = place_[a];
      b = place_[b];
    }
    std::erase_if(pairs, [](const auto& pair) { return pair.first >= pair.second; });
    std::sort(pairs.begin(), pairs.end());
    rowBegin_.assign(free_ + 1, 0);
    column_.reserve(pairs.size());
    for (const auto& [row, column] : pairs) {
      ++rowBegin_[row + 1];
      column_.push_back(column);
    }
    for (int i = 0; i < free_; ++i) rowBegin_[i + 1] += rowBegin_[i];
    const auto slot = [&](int a, int b) {
      if (a < 0 || b < 0) return -1;
      const int pa = place_[a], pb = place_[b], row = std::min(pa, pb);
      if (pa == pb) return -2 - pa;
      const auto found =
          std::lower_bound(column_.begin() + rowBegin_[row], column_.begin() + rowBegin_[row + 1], std::max(pa, pb));
      return 2 * static_cast<int>(found - column_.begin()) + (pa > pb ? 1 : 0);
    };
    for (const TieGroup& group : model_.groups) {
      std::vector<int> slots;
      slots.reserve(static_cast<std::size_t>(group.segments() * group.corners * (group.corners + 1) / 2));
      for (int e = 0; e < group.segments(); ++e)
        for (int p = 0; p < group.corners; ++p)
          for (int q = p; q < group.corners; ++q)
            slots.push_back(slot(freeCorner(group, e, p), freeCorner(group, e, q)));
      slots_.push_back(std::move(slots));
    }
  }

  double* target(int slot) {
    return slot < -1 ? &diagonal_[B::size * static_cast<std::size_t>(-2 - slot)]
                     : &value_[B::size * static_cast<std::size_t>(slot / 2)];
  }

  // Default formulation: T of corner i is phi_i [1 -[d]; 0 1], so a pair gets sum phi_i phi_j X with the slave's X:
  // A = m 1, c = m d, W = m (d^2 1 - d d^T) + I 1.
  void addShapes(const TieGroup& group, const std::vector<int>& slots, const double* slaveMass,
                 const double* slaveInertia, const double* offset) {
    constexpr int numbers = turns ? 10 : 1;
    const bool rotates = group.coupling == Coupling::rotation;
    const int n = group.corners, count = n * (n + 1) / 2;
    const int* slot = slots.data();
    for (int e = 0; e < group.segments(); ++e, slot += count) {
      double sum[10][numbers] = {};
      for (int k = group.begin[e]; k < group.begin[e + 1]; ++k) {
        const int s = group.firstSlave + k;
        const double *phi = &group.weight[static_cast<std::size_t>(n) * k], m = slaveMass[s];
        double x[numbers] = {m};
        if constexpr (turns)
          if (rotates) {
            const double *d = offset + 3 * static_cast<std::size_t>(s), i = slaveInertia[s];
            const double mx = m * d[0], my = m * d[1], mz = m * d[2];
            const double xx = mx * d[0], yy = my * d[1], zz = mz * d[2];
            const double all[10] = {m,          mx,         my,          mz,         yy + zz + i,
                                    -mx * d[1], -mx * d[2], xx + zz + i, -my * d[2], xx + yy + i};
            std::copy_n(all, 10, x);
          }
        int pair = 0;
        for (int p = 0; p < n; ++p)
          for (int q = p; q < n; ++q, ++pair) {
            const double share = phi[p] * phi[q];
            for (int c = 0; c < numbers; ++c) sum[pair][c] += share * x[c];
          }
      }
      int pair = 0;
      for (int p = 0; p < n; ++p)
        for (int q = p; q < n; ++q, ++pair) {
          if (slot[pair] == -1) continue;
          double* b = target(slot[pair]);
          const double times = slot[pair] < -1 && p != q ? 2 : 1;  // one node at two corners
          if constexpr (vv == 1) {
            for (int c = 0; c < numbers; ++c) b[c] += times * sum[pair][c];
          } else {
            for (int c : {0, 4, 8}) b[c] += times * sum[pair][0];
            for (int c = 1; c < numbers; ++c) b[vv + c - 1] += times * sum[pair][c];
          }
        }
    }
  }

  // Optimized formulation: v_s = (1/n - [d] W_i) v_i, w_s = W_i v_i with W_i = Ibar^-1 [r_i].
  void addMeanMotion(const TieGroup& group, const std::vector<int>& slots, const double* slaveMass,
                     const double* slaveInertia, const double* offset, const SegmentFrame* frame) {
    const int n = group.corners;
    const int* slot = slots.data();
    for (int e = 0; e < group.segments(); ++e) {
      double mass = 0, inertia = 0;
      Vec3 moment(0, 0, 0);
      Mat3 outer = Mat3::Zero();
      for (int s = group.firstSlave + group.begin[e]; s < group.firstSlave + group.begin[e + 1]; ++s) {
        const Vec3 d = at(offset, s), md = slaveMass[s] * d;
        mass += slaveMass[s];
        inertia += slaveInertia[s];
        moment += md;
        outer += md * d.transpose();
      }
      const Mat3 second = (outer.trace() + inertia) * Mat3::Identity() - outer;
      const Mat3 lever = skew(moment) / n, inverse = Eigen::Map<const Mat3>(frame[e].inverse);
      Mat3 spin[4], left[4], right[4];
      for (int i = 0; i < n; ++i) {
        spin[i] = inverse * skew(at(frame[e].arm, i));
        left[i] = lever * spin[i];
        right[i] = second * spin[i] + lever;
      }
      for (int i = 0; i < n; ++i)
        for (int j = i; j < n; ++j, ++slot) {
          if (*slot == -1) continue;
          Mat3 block = spin[i].transpose() * right[j] - left[j];
          block.diagonal().array() += mass / (n * n);
          Eigen::Map<Mat3> b(target(*slot));
          if (*slot < -1)
            b += i == j ? block : Mat3(block + block.transpose());
          else if (*slot % 2)
            b += block.transpose();
          else
            b += block;
        }
    }
  }

  [[gnu::always_inline]] Vector ofInverse(int p, const Vector& x) const {
    const Inverse& inverse = inverse_[p];
    if constexpr (!turns) {
      return timesSymmetric(inverse.translation, x);
    } else {
      const double* b = &diagonal_[B::size * static_cast<std::size_t>(p) + vv];
      const Vec3 c(b[0], b[1], b[2]), v = x.template head<3>(), first = timesSymmetric(inverse.translation, v);
      const Vec3 w = timesSymmetric(inverse.rotation, Vec3(x.template tail<3>() - c.cross(first)));
      Vector y;
      y << first + timesSymmetric(inverse.translation, c.cross(w)), w;
      return y;
    }
  }
  [[gnu::always_inline]] Vector ofDiagonal(int p, const Vector& x) const {
    return B::template times<false>(&diagonal_[B::size * static_cast<std::size_t>(p)], x);
  }
  typename B::Map vector(std::vector<double>& v, int p) const {
    return typename B::Map(&v[static_cast<std::size_t>(width) * p]);
  }
  const double* block(int k) const { return &value_[B::size * static_cast<std::size_t>(k)]; }

  // From the first node to the last u = right(node, (L u) of the node): solves (D + L) u = r.
  template <class Right> void forward(Right right, std::vector<double>& u) {
    for (int p = 0; p < free_; ++p) {
      const Vector y = right(p, vector(sweep_, p));
      vector(sweep_, p).setZero();  // for the next sweep
      vector(u, p) = y;
      for (int k = rowBegin_[p]; k < rowBegin_[p + 1]; ++k)
        vector(sweep_, column_[k]) += B::template times<true>(block(k), y);
    }
  }

  // Conjugate gradients on (D + L)^-1 M (D + L)^-T with the middle D as preconditioner [Eisenstat 1981]: an iteration
  // reads each block twice, as a product with M does, M itself being (D + L) + (D + L)^T - D.
  void conjugateGradients() {
    const auto dot = [](const std::vector<double>& a, const std::vector<double>& b) {
      const auto n = static_cast<Eigen::Index>(a.size());
      return Eigen::Map<const Eigen::VectorXd>(a.data(), n).dot(Eigen::Map<const Eigen::VectorXd>(b.data(), n));
    };
    std::fill(direction_.begin(), direction_.end(), 0.0);
    // b - M x, and how large b is.
    double size = 0;
    for (int p = 0; p < free_; ++p) {
      const Vector b = vector(rhs_, p);
      size += b.dot(ofInverse(p, b));
      vector(residual_, p) = b;
    }
    if (size == 0) std::fill(x_.begin(), x_.end(), 0.0);
    for (int p = 0; p < free_; ++p) {
      const Vector x = vector(x_, p);
      Vector sum = ofDiagonal(p, x);
      for (int k = rowBegin_[p]; k < rowBegin_[p + 1]; ++k) {
        sum += B::template times<false>(block(k), vector(x_, column_[k]));
        vector(residual_, column_[k]) -= B::template times<true>(block(k), x);
      }
      vector(residual_, p) -= sum;
    }
    forward([&](int p, const Vector& sum) { return ofInverse(p, vector(residual_, p) - sum); }, residual_);
    const double target = solutionTolerance * solutionTolerance * size;
    double before = 0;
    for (int iteration = 0; iteration < maxIterations; ++iteration) {
      double rho = 0;
      for (int p = 0; p < free_; ++p) {
        const Vector r = vector(residual_, p), z = ofDiagonal(p, r);
        vector(scaled_, p) = z;
        rho += r.dot(z);
      }
      if (!(rho > target)) return;
      const double beta = iteration > 0 ? rho / before : 0;
      before = rho;
      // direction = D r + beta direction; t = (D + L)^-T direction, from the last node to the first, into `scaled_`
      for (int p = free_; p-- > 0;) {
        const Vector d = vector(scaled_, p) + beta * vector(direction_, p);
        vector(direction_, p) = d;
        Vector sum = d;
        for (int k = rowBegin_[p]; k < rowBegin_[p + 1]; ++k)
          sum -= B::template times<false>(block(k), vector(scaled_, column_[k]));
        vector(scaled_, p) = ofInverse(p, sum);
      }
      forward(
          [&](int p, const Vector& sum) {
            const Vector t = vector(scaled_, p);
            return ofInverse(p, vector(direction_, p) - ofDiagonal(p, t) - sum);
          },
          image_);
      const double curvature = dot(direction_, scaled_) + dot(direction_, image_);
      const double step = rho / curvature;
      const auto n = static_cast<Eigen::Index>(x_.size());
      using Whole = Eigen::Map<Eigen::VectorXd>;
      Whole t(scaled_.data(), n), u(image_.data(), n);
      Whole(x_.data(), n) += step * t;
      Whole(residual_.data(), n) -= step * (t + u);
    }
  }

  std::vector<int> place_;                // free node -> place in the sweeps
  std::vector<int> rowBegin_, column_;    // blocks above the diagonal, by rows
  std::vector<double> value_, diagonal_;  // B::size numbers a block
  std::vector<Inverse> inverse_;
  std::vector<std::vector<int>> slots_;  // per group
  std::vector<double> x_, rhs_, residual_, direction_, image_, scaled_, sweep_;
};

}  // namespace

std::unique_ptr<ConsistentInertia> iterativeInertia(const Model& model) {
  const bool mean = std::any_of(model.groups.begin(), model.groups.end(),
                                [](const TieGroup& g) { return g.coupling == Coupling::meanMotion; });
  const bool turns = model.rotating() > model.freeBegin();
  if (mean && turns) return std::make_unique<Iterative<9, true>>(model);
  if (mean) return std::make_unique<Iterative<9, false>>(model);
  if (turns) return std::make_unique<Iterative<1, true>>(model);
  return std::make_unique<Iterative<1, false>>(model);
}

}  // namespace tiefmu
