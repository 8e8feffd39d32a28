#include "lumping.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <vector>

#include "inertia.hpp"
#include "inertia_islands.hpp"
#include "segment.hpp"

namespace tiefmu {
namespace {

constexpr int most = 24;  // four corners, six components each
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most, most>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most, 1>;
using Map = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, most>;

constexpr double noEnergy = 1e-12;  // of the lumped one
constexpr double exact = 1 - 1e-9;

// What is lumped, node by node and slave by slave.
struct Additions {
  std::vector<double> nodeMass, nodeInertia, mass, inertia;  // mass, inertia: four a slave
  explicit Additions(const Model& model)
      : nodeMass(model.nodes()),
        nodeInertia(model.rotating()),
        mass(4 * static_cast<std::size_t>(model.slaves())),
        inertia(mass.size()) {
    const double *m = model.slaveMass.data(), *j = model.slaveInertia.data();
    lumpedAdditions(model, m, j, nodeMass.data(), nodeInertia.data());
    lumpedAdditionsBySlave(model, m, j, mass.data(), inertia.data());
  }
};

// T of one slave: its velocity and spin from those of the corners, theory (2.2), (2.6).
Map mapOf(const Model& model, const TieGroup& group, int e, int slave) {
  const int n = group.corners;
  const Mat3 d = skew(at(model.slaveOffset.data(), slave));
  Map t = Map::Zero(6, 6 * n);
  Vec3 x[4];
  for (int i = 0; i < n; ++i) x[i] = at(model.nodePosition.data(), group.node[static_cast<std::size_t>(n) * e + i]);
  const NodeInertia shape = nodeInertia(n, x);
  for (int i = 0; i < n; ++i) {
    if (group.coupling == Coupling::meanMotion) {
      const Mat3 spin = inverseSymmetric(shape.ibar) * skew(x[i] - shape.centre);
      t.block<3, 3>(0, 6 * i) = Mat3::Identity() / n - d * spin;
      t.block<3, 3>(3, 6 * i) = spin;
      continue;
    }
    const double phi = group.weight[static_cast<std::size_t>(n) * (slave - group.firstSlave) + i];
    t.block<3, 3>(0, 6 * i) = phi * Mat3::Identity();
    if (group.coupling != Coupling::rotation) continue;
    t.block<3, 3>(0, 6 * i + 3) = -phi * d;
    t.block<3, 3>(3, 6 * i + 3) = phi * Mat3::Identity();
  }
  return t;
}

// Own and true inertia of a segment, scaled so that own and lumped are 1: its smallest eigenvalue is 1 / ratio. Only of
// what is free and lumped onto.
Matrix scaled(const Model& model, const Additions& all, const TieGroup& group, int e) {
  const int n = group.corners;
  Vector own = Vector::Zero(6 * n), lumped = Vector::Zero(6 * n);
  Matrix full = Matrix::Zero(6 * n, 6 * n);
  for (int slave = group.firstSlave + group.begin[e]; slave < group.firstSlave + group.begin[e + 1]; ++slave) {
    const Map t = mapOf(model, group, e, slave);
    Eigen::Matrix<double, 6, 1> inertia;
    inertia << Vec3::Constant(model.slaveMass[slave]),
        Vec3::Constant(slave < model.turning() ? model.slaveInertia[slave] : 0);
    full += t.transpose() * inertia.asDiagonal() * t;
    for (int i = 0; i < n; ++i) {
      const std::size_t k = 4 * static_cast<std::size_t>(slave) + i;
      lumped.segment<3>(6 * i).array() += all.mass[k];
      lumped.segment<3>(6 * i + 3).array() += all.inertia[k];
    }
  }
  std::vector<int> moves;
  for (int k = 0; k < 6 * n; ++k) {
    const int node = group.node[static_cast<std::size_t>(n) * e + k / 6];
    if (node < model.freeBegin() || node >= model.freeEnd() || !(lumped[k] > 0)) continue;
    const bool turns = k % 6 >= 3;
    own[k] = turns ? lumped[k] / all.nodeInertia[node] * model.nodeInertia[node]
                   : lumped[k] / all.nodeMass[node] * model.nodeMass[node];
    moves.push_back(k);
  }
  full.diagonal() += own;
  const Vector scale = (own + lumped).cwiseSqrt().cwiseInverse()(moves);
  return scale.asDiagonal() * Matrix(full(moves, moves)) * scale.asDiagonal();
}

// Are all eigenvalues above `shift`?
bool above(Matrix matrix, double shift) {
  matrix.diagonal().array() -= shift;
  return Eigen::LLT<Matrix>(matrix).info() == Eigen::Success;
}

// By bisection, from a value that it is not above; 0 where it is nothing beside 1.
double smallestEigenvalue(const Matrix& matrix, double high) {
  double low = noEnergy;
  if (!above(matrix, low)) return 0;
  while (high - low > 1e-9 * high) {
    const double middle = 0.5 * (low + high);
    (above(matrix, middle) ? low : high) = middle;
  }
  return high;
}

}  // namespace

std::optional<LumpingError> lumpingError(const Model& model) {
  const Additions all(model);
  double smallest = exact;
  std::int64_t segment = 0;
  for (const TieGroup& group : model.groups)
    for (int e = 0; e < group.segments() && smallest > 0; ++e) {
      if (group.begin[e] == group.begin[e + 1]) continue;
      const Matrix matrix = scaled(model, all, group, e);
      if (matrix.size() == 0 || above(matrix, smallest)) continue;
      smallest = smallestEigenvalue(matrix, smallest);
      segment = model.slaveReport[static_cast<std::size_t>(group.firstSlave + group.begin[e])].segment;
    }
  if (smallest == exact) return std::nullopt;
  const double ratio = smallest > 0 ? 1 / smallest : std::numeric_limits<double>::infinity();
  return LumpingError{ratio, segment, !SegmentsAlone(model).rest.empty()};
}

}  // namespace tiefmu
