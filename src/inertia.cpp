#include "inertia.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <utility>

#include "segment.hpp"

namespace tiefmu {
namespace {

// Below this many unknowns (3-vectors) a fresh factor at every geometry is cheaper than conjugate gradients.
constexpr int smallSystem = 96;
constexpr double solverTolerance = 1e-14;  // relative, in the norm of the inverse matrix
constexpr int maxIterations = 400;

// Calls body(group, segment, slave (global), local slave) in order.
template <class Body>
void eachSlave(const Model& model, Body body) {
  for (const TieGroup& group : model.groups)
    for (int e = 0; e < group.segments(); ++e)
      for (int k = group.begin[e]; k < group.begin[e + 1]; ++k) body(group, e, group.firstSlave + k, k);
}

// lambda of a segment at the start, from the nodes' start positions.
double lambdaAtStart(const Model& model, const TieGroup& group, int e) {
  Vec3 x[4];
  for (int i = 0; i < group.corners; ++i)
    x[i] = at(model.nodePosition.data(), group.node[static_cast<std::size_t>(group.corners) * e + i]);
  return nodeInertia(group.corners, x).lambda;
}

}  // namespace

void lumpedAdditions(const Model& model, const double* slaveMass, const double* slaveInertia, double* mass,
                     double* inertia) {
  std::fill(mass, mass + model.nodes(), 0.0);
  std::fill(inertia, inertia + model.rotating(), 0.0);
  double lambda = 0;
  const TieGroup* lastGroup = nullptr;
  int lastSegment = -1;
  eachSlave(model, [&](const TieGroup& group, int e, int s, int k) {
    const int n = group.corners, *node = &group.node[static_cast<std::size_t>(n) * e];
    const double m = slaveMass[s], own = s < model.turning() ? slaveInertia[s] : 0;
    const double d2 = at(model.slaveOffset.data(), s).squaredNorm();
    if (group.coupling == Coupling::meanMotion) {
      if (&group != lastGroup || e != lastSegment) {
        lambda = lambdaAtStart(model, group, e);
        lastGroup = &group;
        lastSegment = e;
      }
      for (int i = 0; i < n; ++i) mass[node[i]] += m / n + (own + m * d2) * lambda;
      return;
    }
    const Phi phi = clamped(n, &group.weight[static_cast<std::size_t>(n) * k]);
    for (int i = 0; i < n; ++i) mass[node[i]] += phi[i] * m;
    if (group.coupling == Coupling::rotation)
      for (int i = 0; i < n; ++i) inertia[node[i]] += phi[i] * (own + m * d2);
  });
}

void nodalStiffness(const Model& model, double* translation, double* rotation) {
  std::copy(model.nodeStiffness.begin(), model.nodeStiffness.end(), translation);
  std::copy_n(model.nodeRotationalStiffness.begin(), model.rotating(), rotation);
  std::vector<double> k = model.slaveStiffness, kr = model.slaveRotationalStiffness;
  k.resize(model.slaves());
  kr.resize(model.slaves());
  for (const Spring& spring : model.springs) {
    const double stiffness = spring.stiffness.maxCoeff(), turning = spring.rotationalStiffness.maxCoeff();
    for (const SpringEnd* end : {&spring.a, &spring.b}) {
      // The second end of a bushing also carries the moment of the shear force.
      const double arm2 =
          spring.kind == SpringKind::bushing && end == &spring.b ? spring.arm.squaredNorm() : 0;
      if (end->slave >= 0) {
        k[end->slave] += stiffness;
        kr[end->slave] += turning + stiffness * arm2;
      } else if (end->node >= 0) {
        translation[end->node] += stiffness;
        if (end->node < model.rotating()) rotation[end->node] += turning + stiffness * arm2;
      }
    }
  }
  eachSlave(model, [&](const TieGroup& group, int e, int s, int local) {
    const int n = group.corners, *node = &group.node[static_cast<std::size_t>(n) * e];
    const double d2 = at(model.slaveOffset.data(), s).squaredNorm();
    if (group.coupling == Coupling::meanMotion) {
      if (k[s] == 0 && kr[s] == 0) return;
      const double lambda = lambdaAtStart(model, group, e);
      for (int i = 0; i < n; ++i) translation[node[i]] += k[s] / n + lambda * (kr[s] + k[s] * d2);
      return;
    }
    const Phi phi = clamped(n, &group.weight[static_cast<std::size_t>(n) * local]);
    for (int i = 0; i < n; ++i) translation[node[i]] += phi[i] * k[s];
    if (group.coupling == Coupling::rotation)
      for (int i = 0; i < n; ++i) rotation[node[i]] += phi[i] * (kr[s] + k[s] * d2);
  });
}

ConsistentInertia::ConsistentInertia(const Model& model)
    : model_(model), free_(model.free()), freeRotating_(model.rotating() - model.freeBegin()) {
  const bool turning = model.turning() > 0;
  const bool shapes = std::any_of(model.groups.begin(), model.groups.end(),
                                  [](const TieGroup& g) { return g.coupling == Coupling::meanMotion; });
  const bool offsets = std::any_of(model.slaveOffset.begin(), model.slaveOffset.begin() + 3 * model.turning(),
                                   [](double d) { return d != 0; });
  constant_ = !model.finite() || !turning || (!shapes && !offsets);
  unknowns_ = free_ + freeRotating_;
  width_ = turning ? 3 : 1;
  direct_ = constant_ || unknowns_ <= smallSystem;
  findPattern();
  if (direct_) findFactorPattern();
  x_.resize(3 * static_cast<std::size_t>(unknowns_));
  rhs_.resize(x_.size());
  if (!direct_)
    for (auto* v : {&residual_, &direction_, &image_, &preconditioned_}) v->resize(x_.size());
}

// Unknowns of a segment: the translations of its corners, then, for a rotation coupling, their rotations.
void ConsistentInertia::findPattern() {
  const auto unknown = [&](const TieGroup& group, int e, int local) {
    const int node = group.node[static_cast<std::size_t>(group.corners) * e + local % group.corners] - model_.freeBegin();
    if (node < 0 || node >= free_) return -1;
    return local < group.corners ? node : free_ + node;
  };
  std::vector<std::pair<int, int>> pairs;
  for (const TieGroup& group : model_.groups) {
    const int locals = group.coupling == Coupling::rotation ? 2 * group.corners : group.corners;
    for (int e = 0; e < group.segments(); ++e)
      for (int p = 0; p < locals; ++p)
        for (int q = p + 1; q < locals; ++q) {
          const int a = unknown(group, e, p), b = unknown(group, e, q);
          if (a >= 0 && b >= 0) pairs.emplace_back(a, b);
        }
  }
  position_.resize(unknowns_);
  {
    std::vector<Eigen::Triplet<double>> entries;
    for (int i = 0; i < unknowns_; ++i) entries.emplace_back(i, i, 1.0);
    for (const auto& [a, b] : pairs) {
      entries.emplace_back(a, b, 1.0);
      entries.emplace_back(b, a, 1.0);
    }
    Eigen::SparseMatrix<double> graph(unknowns_, unknowns_);
    graph.setFromTriplets(entries.begin(), entries.end());
    Eigen::PermutationMatrix<Eigen::Dynamic> order;
    Eigen::AMDOrdering<int>()(graph, order);
    for (int i = 0; i < unknowns_; ++i) position_[order.indices()[i]] = i;
  }
  std::vector<std::pair<int, int>> blocks;  // (column, row), row <= column
  for (int i = 0; i < unknowns_; ++i) blocks.emplace_back(i, i);
  for (auto [a, b] : pairs) {
    a = position_[a];
    b = position_[b];
    blocks.emplace_back(std::max(a, b), std::min(a, b));
  }
  std::sort(blocks.begin(), blocks.end());
  blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
  columnBegin_.assign(unknowns_ + 1, 0);
  for (const auto& [column, row] : blocks) {
    ++columnBegin_[column + 1];
    row_.push_back(row);
  }
  for (int i = 0; i < unknowns_; ++i) columnBegin_[i + 1] += columnBegin_[i];
  value_.resize(static_cast<std::size_t>(width_) * width_ * row_.size());

  const auto slot = [&](int a, int b) {
    if (a < 0 || b < 0) return -1;
    const int pa = position_[a], pb = position_[b], column = std::max(pa, pb), row = std::min(pa, pb);
    const auto found = std::lower_bound(row_.begin() + columnBegin_[column], row_.begin() + columnBegin_[column + 1], row);
    return 2 * static_cast<int>(found - row_.begin()) + (pa > pb ? 1 : 0);
  };
  for (const TieGroup& group : model_.groups) {
    const int locals = group.coupling == Coupling::rotation ? 2 * group.corners : group.corners;
    std::vector<int> slots;
    slots.reserve(static_cast<std::size_t>(group.segments()) * locals * (locals + 1) / 2);
    for (int e = 0; e < group.segments(); ++e)
      for (int p = 0; p < locals; ++p)
        for (int q = p; q < locals; ++q) slots.push_back(slot(unknown(group, e, p), unknown(group, e, q)));
    slots_.push_back(std::move(slots));
  }
}

// Elimination tree and column counts of L, row by row of the upper triangle.
void ConsistentInertia::findFactorPattern() {
  const int size = unknowns_ * width_;
  parent_.assign(size, -1);
  count_.assign(size, 0);
  flag_.assign(size, -1);
  stack_.resize(2 * static_cast<std::size_t>(size));
  pivot_.resize(size);
  row1_.assign(size, 0.0);
  std::vector<int> columns(size, 0);
  for (int k = 0; k < size; ++k) {
    flag_[k] = k;
    const int column = k / width_;
    for (int b = columnBegin_[column]; b < columnBegin_[column + 1]; ++b)
      for (int r = 0; r < width_; ++r)
        for (int i = width_ * row_[b] + r; i < k && flag_[i] != k; i = parent_[i]) {
          if (parent_[i] < 0) parent_[i] = k;
          ++columns[i];
          flag_[i] = k;
        }
  }
  factorBegin_.assign(size + 1, 0);
  for (int k = 0; k < size; ++k) factorBegin_[k + 1] = factorBegin_[k] + columns[k];
  factorRow_.resize(factorBegin_[size]);
  factorValue_.resize(factorBegin_[size]);
}

// L D L^T, one row of L at a time: the row's pattern is what the elimination tree reaches from the column's entries.
bool ConsistentInertia::factor() {
  const int size = unknowns_ * width_;
  int* pattern = stack_.data();
  std::fill(flag_.begin(), flag_.end(), -1);
  for (int k = 0; k < size; ++k) {
    count_[k] = 0;
    flag_[k] = k;
    int top = size;
    const int column = k / width_, inner = k % width_;
    for (int b = columnBegin_[column]; b < columnBegin_[column + 1]; ++b)
      for (int r = 0; r < width_; ++r) {
        int i = width_ * row_[b] + r;
        if (i > k) continue;
        row1_[i] = value_[static_cast<std::size_t>(width_) * (static_cast<std::size_t>(width_) * b + inner) + r];
        int length = 0;
        for (; flag_[i] != k; i = parent_[i]) {
          stack_[size + length++] = i;
          flag_[i] = k;
        }
        while (length > 0) pattern[--top] = stack_[size + --length];
      }
    const double diagonal = row1_[k];
    double pivot = diagonal;
    row1_[k] = 0;
    for (; top < size; ++top) {
      const int i = pattern[top];
      const double y = row1_[i];
      row1_[i] = 0;
      const int end = factorBegin_[i] + count_[i];
      for (int p = factorBegin_[i]; p < end; ++p) row1_[factorRow_[p]] -= factorValue_[p] * y;
      const double l = y / pivot_[i];
      pivot -= l * y;
      factorRow_[end] = k;
      factorValue_[end] = l;
      ++count_[i];
    }
    pivot_[k] = pivot;
    if (!(pivot > 1e-13 * diagonal)) {
      std::fill(row1_.begin(), row1_.end(), 0.0);
      stack_[0] = k;  // for the message
      return false;
    }
  }
  return true;
}

void ConsistentInertia::substitute(double* x) const {
  const int size = unknowns_ * width_, m = 3 / width_;  // m right sides side by side
  for (int j = 0; j < size; ++j)
    for (int p = factorBegin_[j]; p < factorBegin_[j + 1]; ++p)
      for (int c = 0; c < m; ++c) x[m * static_cast<std::size_t>(factorRow_[p]) + c] -= factorValue_[p] * x[m * static_cast<std::size_t>(j) + c];
  for (int j = 0; j < size; ++j)
    for (int c = 0; c < m; ++c) x[m * static_cast<std::size_t>(j) + c] /= pivot_[j];
  for (int j = size - 1; j >= 0; --j)
    for (int p = factorBegin_[j]; p < factorBegin_[j + 1]; ++p)
      for (int c = 0; c < m; ++c) x[m * static_cast<std::size_t>(j) + c] -= factorValue_[p] * x[m * static_cast<std::size_t>(factorRow_[p]) + c];
}

void ConsistentInertia::addBlock(int slot, const Mat3& block) {
  if (slot < 0) return;
  Eigen::Map<Mat3> target(&value_[9 * static_cast<std::size_t>(slot / 2)]);
  if (slot % 2) target += block.transpose();
  else target += block;
}

void ConsistentInertia::addSegments(const TieGroup& group, const std::vector<int>& slots, const double* slaveMass,
                                    const double* slaveInertia, const double* offset, const SegmentFrame* frame) {
  const int n = group.corners;
  const int* slot = slots.data();
  for (int e = 0; e < group.segments(); ++e) {
    const int first = group.firstSlave + group.begin[e], last = group.firstSlave + group.begin[e + 1];
    const double* phi = &group.weight[static_cast<std::size_t>(n) * group.begin[e]];
    if (group.coupling == Coupling::meanMotion) {
      // T for corner i: v_s = (1/n - [d] W_i) v_i, w_s = W_i v_i, W_i = Ibar^-1 [r_i]
      double mass = 0;
      Vec3 moment(0, 0, 0);
      Mat3 second = Mat3::Zero();
      for (int s = first; s < last; ++s) {
        const Vec3 d = at(offset, s);
        mass += slaveMass[s];
        moment += slaveMass[s] * d;
        second += slaveMass[s] * (d.squaredNorm() * Mat3::Identity() - d * d.transpose()) +
                  slaveInertia[s] * Mat3::Identity();
      }
      const Eigen::Map<const Mat3> inverse(frame[e].inverse);
      Mat3 spin[4];
      for (int i = 0; i < n; ++i) spin[i] = inverse * skew(at(frame[e].arm, i));
      const Mat3 lever = skew(moment) / n;
      for (int i = 0; i < n; ++i)
        for (int j = i; j < n; ++j)
          addBlock(*slot++, mass / (n * n) * Mat3::Identity() - lever * spin[j] + spin[i].transpose() * lever +
                                spin[i].transpose() * second * spin[j]);
      continue;
    }
    const int locals = group.coupling == Coupling::rotation ? 2 * n : n;
    for (int p = 0; p < locals; ++p)
      for (int q = p; q < locals; ++q, ++slot) {
        if (*slot < 0) continue;
        const int i = p % n, j = q % n;
        if (q < n && width_ == 1) {
          for (int s = first; s < last; ++s)
            value_[*slot / 2] += slaveMass[s] * phi[n * (s - first) + i] * phi[n * (s - first) + j];
          continue;
        }
        Mat3 block = Mat3::Zero();
        for (int s = first; s < last; ++s) {
          const double share = phi[n * (s - first) + i] * phi[n * (s - first) + j];
          if (q < n) {
            block += share * slaveMass[s] * Mat3::Identity();
          } else {
            const Vec3 d = at(offset, s);
            if (p < n) block -= share * slaveMass[s] * skew(d);
            else
              block += share * (slaveMass[s] * (d.squaredNorm() * Mat3::Identity() - d * d.transpose()) +
                                slaveInertia[s] * Mat3::Identity());
          }
        }
        addBlock(*slot, block);
      }
  }
}

void ConsistentInertia::update(const double* nodeMass, const double* nodeInertia, const double* slaveMass,
                               const double* slaveInertia, const double* offset,
                               const std::vector<SegmentFrame>& frames) {
  std::fill(value_.begin(), value_.end(), 0.0);
  for (int i = 0; i < unknowns_; ++i) {
    const double own = i < free_ ? nodeMass[model_.freeBegin() + i] : nodeInertia[model_.freeBegin() + i - free_];
    const int p = position_[i];
    const std::size_t diagonal = static_cast<std::size_t>(columnBegin_[p + 1]) - 1;  // rows ascend: the last is p
    for (int c = 0; c < width_; ++c) value_[width_ * width_ * diagonal + (width_ + 1) * c] += own;
  }
  std::size_t frame = 0;
  for (std::size_t g = 0; g < model_.groups.size(); ++g) {
    const TieGroup& group = model_.groups[g];
    addSegments(group, slots_[g], slaveMass, slaveInertia, offset, frames.data() + frame);
    if (group.coupling == Coupling::meanMotion) frame += group.segments();
  }
  const auto refuse = [&](int position) {
    const int unknown = static_cast<int>(std::find(position_.begin(), position_.end(), position) - position_.begin());
    const bool turn = unknown >= free_;
    throw SceneError("node " + std::to_string(model_.nodeId[model_.freeBegin() + (turn ? unknown - free_ : unknown)]) +
                     ": is free but has no " + (turn ? "inertia" : "mass") +
                     " of its own, and the slaves tied to it do not give it enough for a consistent mass matrix");
  };
  if (direct_) {
    if (!factor()) refuse(stack_[0] / width_);
    return;
  }
  diagonal_.resize(9 * static_cast<std::size_t>(unknowns_));
  for (int p = 0; p < unknowns_; ++p) {
    const Eigen::Map<const Mat3> block(&value_[9 * (static_cast<std::size_t>(columnBegin_[p + 1]) - 1)]);
    if (!(block.diagonal().minCoeff() > 0)) refuse(p);
    Eigen::Map<Mat3> inverse(&diagonal_[9 * static_cast<std::size_t>(p)]);
    inverse = inverseSymmetric(block);
  }
}

void ConsistentInertia::product(const double* x, double* y) const {
  std::fill(y, y + 3 * static_cast<std::size_t>(unknowns_), 0.0);
  for (int column = 0; column < unknowns_; ++column)
    for (int b = columnBegin_[column]; b < columnBegin_[column + 1]; ++b) {
      const int row = row_[b];
      if (width_ == 1) {
        at(y, row) += value_[b] * at(x, column);
        if (row != column) at(y, column) += value_[b] * at(x, row);
      } else {
        const Eigen::Map<const Mat3> block(&value_[9 * static_cast<std::size_t>(b)]);
        at(y, row) += block * at(x, column);
        if (row != column) at(y, column) += block.transpose() * at(x, row);
      }
    }
}

void ConsistentInertia::conjugateGradients() {
  using Vector = Eigen::Map<Eigen::VectorXd>;
  const Eigen::Index size = static_cast<Eigen::Index>(x_.size());
  Vector x(x_.data(), size), r(residual_.data(), size), d(direction_.data(), size), ad(image_.data(), size),
      z(preconditioned_.data(), size), b(rhs_.data(), size);
  const auto precondition = [&](const Vector& from, Vector& to) {
    for (int p = 0; p < unknowns_; ++p)
      at(to.data(), p) = Eigen::Map<const Mat3>(&diagonal_[9 * static_cast<std::size_t>(p)]) * at(from.data(), p);
  };
  precondition(b, z);
  const double target = solverTolerance * solverTolerance * b.dot(z);
  product(x_.data(), ad.data());
  r = b - ad;
  precondition(r, z);
  d = z;
  double rz = r.dot(z);
  for (int iteration = 0; iteration < maxIterations && rz > target; ++iteration) {
    product(d.data(), ad.data());
    const double step = rz / d.dot(ad);
    x += step * d;
    r -= step * ad;
    precondition(r, z);
    const double next = r.dot(z);
    d = z + (next / rz) * d;
    rz = next;
  }
}

void ConsistentInertia::solve(const double* force, const double* moment, double* a, double* z) {
  for (int i = 0; i < unknowns_; ++i) {
    at(rhs_.data(), position_[i]) = i < free_ ? at(force, i) : at(moment, i - free_);
    at(x_.data(), position_[i]) = i < free_ ? at(a, i) : at(z, i - free_);
  }
  if (direct_) {
    x_ = rhs_;
    substitute(x_.data());
  } else {
    conjugateGradients();
  }
  for (int i = 0; i < unknowns_; ++i) {
    if (i < free_) at(a, i) = at(x_.data(), position_[i]);
    else at(z, i - free_) = at(x_.data(), position_[i]);
  }
}

void ConsistentInertia::multiply(const double* a, const double* z, double* force, double* moment) {
  for (int i = 0; i < unknowns_; ++i) at(x_.data(), position_[i]) = i < free_ ? at(a, i) : at(z, i - free_);
  product(x_.data(), rhs_.data());
  for (int i = 0; i < unknowns_; ++i) {
    if (i < free_) at(force, i) = at(rhs_.data(), position_[i]);
    else at(moment, i - free_) = at(rhs_.data(), position_[i]);
  }
}

}  // namespace tiefmu
