#include "inertia_direct.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <utility>

namespace tiefmu {
namespace {

// Unknowns are 3-vectors: the free nodes' accelerations, then the angular accelerations of those that rotate. Where no
// slave turns the three components part and the matrix is scalar, one row a node.
class Direct : public ConsistentInertia {
 public:
  Direct(const Model& model, const std::vector<int>& nodes);
  void prepare(const double*, const double*) override {}
  void update(const InertiaGeometry& geometry) override;
  void solve(const Ties& ties, double tolerance, const double* force, const double* moment, double* a,
             double* z) override;

 private:
  // Of the model, which unknown i moves or turns.
  int node(int i) const { return model_.freeBegin() + node_[i < free_ ? i : i - free_]; }
  void findPattern();
  void findFactorPattern();
  void addBlock(int slot, const Mat3& block);
  void addSegments(const TieGroup& group, const std::vector<int>& slots, const double* slaveMass,
                   const double* slaveInertia, const double* offset, const SegmentFrame* frame);
  bool factor();
  template <int m> void substitute(double* x) const;

  int unknowns_, width_;                 // width_: 3, or 1 where components part
  std::vector<int> position_;            // unknown -> place in the factor's order
  std::vector<int> columnBegin_, row_;   // upper triangle of blocks, by columns, in that order
  std::vector<double> value_;            // width_ squared per block, column by column
  std::vector<std::vector<int>> slots_;  // per group: 2 * block + transposed for each pair of a segment, or -1
  std::vector<int> parent_, factorBegin_, factorRow_, count_, flag_, stack_;
  std::vector<double> factorValue_, pivot_, row1_;  // L D L^T
  std::vector<double> x_;
};

Direct::Direct(const Model& model, const std::vector<int>& nodes) : ConsistentInertia(model, nodes) {
  unknowns_ = free_ + freeRotating_;
  width_ = turning_ ? 3 : 1;
  findPattern();
  findFactorPattern();
  x_.resize(3 * static_cast<std::size_t>(unknowns_));
}

// Unknowns of a segment: the translations of its corners, then, for a rotation coupling, their rotations.
void Direct::findPattern() {
  const auto unknown = [&](const TieGroup& group, int e, int local) {
    const int node = numberOf(group.node[static_cast<std::size_t>(group.corners) * e + local % group.corners]);
    return node < 0 || local < group.corners ? node : free_ + node;
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
    const auto found =
        std::lower_bound(row_.begin() + columnBegin_[column], row_.begin() + columnBegin_[column + 1], row);
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
void Direct::findFactorPattern() {
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
bool Direct::factor() {
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

// m right sides side by side.
template <int m> void Direct::substitute(double* x) const {
  using Right = Eigen::Matrix<double, m, 1>;
  const auto row = [&](int i) { return Eigen::Map<Right>(x + m * static_cast<std::ptrdiff_t>(i)); };
  const int size = unknowns_ * width_;
  for (int j = 0; j < size; ++j) {
    const Right y = row(j);
    for (int p = factorBegin_[j]; p < factorBegin_[j + 1]; ++p) row(factorRow_[p]) -= factorValue_[p] * y;
  }
  for (int j = size - 1; j >= 0; --j) {
    Right y = row(j) / pivot_[j];
    for (int p = factorBegin_[j]; p < factorBegin_[j + 1]; ++p) y -= factorValue_[p] * row(factorRow_[p]);
    row(j) = y;
  }
}

void Direct::addBlock(int slot, const Mat3& block) {
  if (slot < 0) return;
  Eigen::Map<Mat3> target(&value_[9 * static_cast<std::size_t>(slot / 2)]);
  if (slot % 2)
    target += block.transpose();
  else
    target += block;
}

void Direct::addSegments(const TieGroup& group, const std::vector<int>& slots, const double* slaveMass,
                         const double* slaveInertia, const double* offset, const SegmentFrame* frame) {
  const int n = group.corners;
  const int* slot = slots.data();
  const int corners = group.coupling == Coupling::rotation ? 2 * n : n, count = corners * (corners + 1) / 2;
  for (int e = 0; e < group.segments(); ++e) {
    if (std::all_of(slot, slot + count, [](int k) { return k < 0; })) {  // a segment that is solved by itself
      slot += count;
      continue;
    }
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
        second += slaveMass[s] * unitInertia(d) + slaveInertia[s] * Mat3::Identity();
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
            if (p < n)
              block -= share * slaveMass[s] * skew(d);
            else
              block += share * (slaveMass[s] * unitInertia(d) + slaveInertia[s] * Mat3::Identity());
          }
        }
        addBlock(*slot, block);
      }
  }
}

void Direct::update(const InertiaGeometry& geometry) {
  std::fill(value_.begin(), value_.end(), 0.0);
  for (int i = 0; i < unknowns_; ++i) {
    const double own = i < free_ ? model_.nodeMass[node(i)] : model_.nodeInertia[node(i)];
    const int p = position_[i];
    const std::size_t diagonal = static_cast<std::size_t>(columnBegin_[p + 1]) - 1;  // rows ascend: the last is p
    for (int c = 0; c < width_; ++c) value_[width_ * width_ * diagonal + (width_ + 1) * c] += own;
  }
  std::size_t frame = 0;
  for (std::size_t g = 0; g < model_.groups.size(); ++g) {
    const TieGroup& group = model_.groups[g];
    addSegments(group, slots_[g], geometry.slaveMass, geometry.slaveInertia, geometry.offset,
                geometry.ties.frames().data() + frame);
    if (group.coupling == Coupling::meanMotion) frame += group.segments();
  }
  if (factor()) return;
  const int unknown =
      static_cast<int>(std::find(position_.begin(), position_.end(), stack_[0] / width_) - position_.begin());
  refuse(unknown < free_ ? unknown : unknown - free_, unknown >= free_);
}

void Direct::solve(const Ties&, double, const double* force, const double* moment, double* a, double* z) {
  const auto load = [&](int i) { return i < free_ ? at(force, node(i)) : at(moment, node(i)); };
  for (int i = 0; i < unknowns_; ++i) at(x_.data(), position_[i]) = load(i);
  if (width_ == 1)
    substitute<3>(x_.data());
  else
    substitute<1>(x_.data());
  for (int i = 0; i < unknowns_; ++i) at(i < free_ ? a : z, node(i)) = at(x_.data(), position_[i]);
}

}  // namespace

std::unique_ptr<ConsistentInertia> directInertia(const Model& model, const std::vector<int>& nodes) {
  return std::make_unique<Direct>(model, nodes);
}

}  // namespace tiefmu
