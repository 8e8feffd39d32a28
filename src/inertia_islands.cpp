#include "inertia_islands.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <numeric>

#include "inertia.hpp"
#include "tie.hpp"

namespace tiefmu {
namespace {

// Below this ratio of the eigenvalues of the corners' mobility the rigid motions are hardly told apart.
constexpr double flattest = 1e-5;
constexpr int pieceSize = 64 * segmentLanes;

const SegmentKernels& kernels() {
#ifdef TIEFMU_AVX2
  if (!usesBaselineKernels()) return avx2SegmentKernels;
#endif
  return baselineSegmentKernels;
}

template <class Body> void eachCorner(const Model& model, const TieGroup& group, int e, Body body) {
  for (int i = 0; i < group.corners; ++i) {
    const int node = group.node[static_cast<std::size_t>(group.corners) * e + i];
    body(i, node, node >= model.freeBegin() && node < model.freeEnd());
  }
}

template <class Body> void eachSegment(const Model& model, Body body) {
  for (std::size_t g = 0; g < model.groups.size(); ++g)
    for (int e = 0; e < model.groups[g].segments(); ++e)
      if (model.groups[g].begin[e] < model.groups[g].begin[e + 1]) body(g, model.groups[g], e);
}

// `uses`: how many segments hold each free node. One free corner will do.
bool standsAlone(const Model& model, const TieGroup& group, int e, const std::vector<int>& uses) {
  bool good = true;
  int count = 0;
  double mobility = 0;
  Vec3 x[4], centre(0, 0, 0);
  double w[4];
  eachCorner(model, group, e, [&](int i, int node, bool isFree) {
    for (int j = 0; j < i; ++j) good = good && node != group.node[static_cast<std::size_t>(group.corners) * e + j];
    if (!isFree) return;
    good = good && uses[node - model.freeBegin()] == 1 && model.nodeMass[node] > 0;
    if (group.coupling == Coupling::rotation) good = good && model.nodeInertia[node] > 0;
    x[count] = at(model.nodePosition.data(), node);
    w[count] = 1 / model.nodeMass[node];
    centre += w[count] * x[count];
    mobility += w[count++];
  });
  if (!good || count == 0) return false;
  if (group.coupling != Coupling::meanMotion) return true;
  Mat3 inertia = Mat3::Zero();
  for (int i = 0; i < count; ++i) {
    const Vec3 r = x[i] - centre / mobility;
    inertia += w[i] * unitInertia(r);
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(inertia, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues()(0) > flattest * eigen.eigenvalues()(2);
}

}  // namespace

SegmentsAlone::SegmentsAlone(const Model& model) {
  std::vector<int> uses(model.free(), 0);
  eachSegment(model, [&](std::size_t, const TieGroup& group, int e) {
    eachCorner(model, group, e, [&](int, int node, bool isFree) {
      if (isFree) ++uses[node - model.freeBegin()];
    });
  });
  std::vector<std::uint8_t> isRest(model.free(), 0), turns(model.free(), 0);
  for (const TieGroup& group : model.groups) held.emplace_back(group.segments(), 0);
  eachSegment(model, [&](std::size_t g, const TieGroup& group, int e) {
    const bool here = standsAlone(model, group, e, uses);
    held[g][e] = here;
    eachCorner(model, group, e, [&](int, int node, bool isFree) {
      allFree = allFree && isFree;
      if (!isFree) return;
      if (!here) isRest[node - model.freeBegin()] = 1;
      if (here && group.coupling == Coupling::rotation) turns[node - model.freeBegin()] = 1;
    });
  });
  for (int i = 0; i < model.free(); ++i) {
    if (isRest[i]) {
      rest.push_back(i);
      continue;
    }
    if (uses[i] == 0) own.push_back(i);
    if (i < model.rotating() - model.freeBegin() && !turns[i]) ownTurning.push_back(i);
  }
}

Islands::Islands(const Model& model) : model_(model), alone_(model) {
  for (std::size_t g = 0; g < model.groups.size(); ++g) addLists(g);
  for (std::size_t k = 0; k < lists_.size(); ++k)
    for (int first = 0; first < static_cast<int>(lists_[k].segment.size()); first += pieceSize)
      pieces_.push_back({k, first, std::min(pieceSize, static_cast<int>(lists_[k].segment.size()) - first)});
  fastest_.resize(pieces_.size());
}

// By the number of slaves, so that four side by side have as many.
void Islands::addLists(std::size_t g) {
  const TieGroup& group = model_.groups[g];
  std::vector<int> kindOf(group.segments(), -1), slaves(group.segments());
  std::vector<std::uint8_t> mixed(group.segments(), 0);
  for (int e = 0; e < group.segments(); ++e) {
    slaves[e] = group.begin[e + 1] - group.begin[e];
    if (!alone_.held[g][e]) continue;
    kindOf[e] = group.coupling == Coupling::translation  ? static_cast<int>(Kind::translation)
                : group.coupling == Coupling::meanMotion ? static_cast<int>(Kind::body)
                : slaves[e] == 1                         ? static_cast<int>(Kind::pair)
                                                         : static_cast<int>(Kind::many);
    eachCorner(model_, group, e, [&](int, int, bool isFree) { mixed[e] |= !isFree; });
  }
  static constexpr int count[kinds] = {translationPlane::count, pairPlane::count, manyPlane::count, bodyPlane::count};
  for (int kind = 0; kind < kinds; ++kind)
    for (int known = 0; known < 2; ++known) {
      List list{static_cast<int>(g), static_cast<Kind>(kind), known == 1, {}, {}};
      for (int e = 0; e < group.segments(); ++e)
        if (kindOf[e] == kind && mixed[e] == known) list.segment.push_back(e);
      if (list.segment.empty()) continue;
      std::stable_sort(list.segment.begin(), list.segment.end(), [&](int a, int b) { return slaves[a] < slaves[b]; });
      while (list.segment.size() % segmentLanes) list.segment.push_back(list.segment.back());
      list.planes.resize(static_cast<std::size_t>(count[kind]) * list.segment.size());
      lists_.push_back(std::move(list));
    }
}

// The planes of the list's segment at `place`.
void Islands::fill(List& list, std::size_t place, const double* slaveMass, const double* slaveInertia) {
  const TieGroup& group = model_.groups[list.group];
  const int e = list.segment[place], n = group.corners;
  const std::size_t count = list.planes.size() / list.segment.size();
  double* base = &list.planes[place / segmentLanes * segmentLanes * count + place % segmentLanes];
  const auto plane = [&](int k) -> double& { return base[static_cast<std::ptrdiff_t>(segmentLanes) * k]; };
  const int first = group.firstSlave + group.begin[e], last = group.firstSlave + group.begin[e + 1];
  const auto phi = [&](int s, int i) { return group.weight[static_cast<std::size_t>(n) * (s - group.firstSlave) + i]; };
  double mobility[4] = {}, turning[4] = {};
  bool isFree[4] = {};
  eachCorner(model_, group, e, [&](int i, int node, bool f) {
    isFree[i] = f;
    if (!f) return;
    mobility[i] = 1 / model_.nodeMass[node];
    if (group.coupling == Coupling::rotation) turning[i] = 1 / model_.nodeInertia[node];
  });
  const double* offset = model_.slaveOffset.data();

  if (list.kind == Kind::translation || list.kind == Kind::many) {
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity(), coupled = Eigen::Matrix4d::Zero();
    for (int s = first; s < last; ++s)
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) coupled(i, j) += slaveMass[s] * phi(s, i) * phi(s, j);
    for (int i = 0; i < n; ++i) {
      if (isFree[i]) m(i, i) = model_.nodeMass[group.node[static_cast<std::size_t>(n) * e + i]];
      for (int j = 0; j < n; ++j)
        if (isFree[i] && isFree[j]) m(i, j) += coupled(i, j);
    }
    Eigen::Matrix4d inverse = m.ldlt().solve(Eigen::Matrix4d::Identity());
    inverse = (0.5 * (inverse + inverse.transpose())).eval();
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const bool both = i < n && j < n && isFree[i] && isFree[j];
        if (list.kind == Kind::many) {
          plane(manyPlane::inverse + 4 * i + j) = both ? inverse(i, j) : 0;
          continue;
        }
        double b = both ? inverse(i, j) : i == j ? 1 : 0;
        if (i < n && j < n && isFree[i] && !isFree[j]) {
          b = 0;
          for (int k = 0; k < n; ++k)
            if (isFree[k]) b -= inverse(i, k) * coupled(k, j);
        }
        plane(translationPlane::matrix + 4 * i + j) = b;
      }
  }
  if (list.kind == Kind::many)
    for (int i = 0; i < 4; ++i) {
      plane(manyPlane::free + i) = isFree[i];
      plane(manyPlane::inertia + i) = isFree[i] ? 1 / turning[i] : 1;
    }
  if (list.kind == Kind::pair) {
    const double m = slaveMass[first], inertia = slaveInertia[first], d2 = at(offset, first).squaredNorm();
    double sm = 0, sJ = 0;
    for (int i = 0; i < n; ++i) {
      const double f = phi(first, i);
      plane(pairPlane::weight + i) = f;
      plane(pairPlane::inverseMass + i) = mobility[i];
      plane(pairPlane::inverseInertia + i) = turning[i];
      sm += f * f * mobility[i];
      sJ += f * f * turning[i];
    }
    const double k = 1 / (1 + m * sm);
    plane(pairPlane::k) = k;
    plane(pairPlane::km) = k * m;
    plane(pairPlane::sJ) = sJ;
    plane(pairPlane::inverseSJ) = sJ > 0 ? 1 / sJ : 0;
    plane(pairPlane::whole) = 1 / (1 + sJ * (inertia + k * m * d2));
    plane(pairPlane::twist) = sJ * k * m / (1 + sJ * inertia);
  }
  if (list.kind == Kind::body) {
    double sum = 0;
    for (int i = 0; i < n; ++i) {
      plane(bodyPlane::inverseMass + i) = mobility[i];
      sum += mobility[i];
    }
    plane(bodyPlane::s) = 1 / sum;
    const SlaveBody body = slaveBody(model_, group, e, slaveMass, slaveInertia);
    plane(bodyPlane::mass) = body.mass;
    for (int k = 0; k < 3; ++k) plane(bodyPlane::moment + k) = body.moment[k];
    for (int k = 0; k < 6; ++k) plane(bodyPlane::inertia + k) = body.inertia[k];
  }
}

void Islands::update(const double* slaveMass, const double* slaveInertia) {
  const auto refuse = [&](int node, const char* what) {
    throw SceneError("node " + std::to_string(model_.nodeId[node]) + ": is free but has no " + what +
                     " of its own, and the slaves tied to it do not give it enough for a consistent mass matrix");
  };
  for (int i : alone_.own)
    if (!(model_.nodeMass[model_.freeBegin() + i] > 0)) refuse(model_.freeBegin() + i, "mass");
  for (int i : alone_.ownTurning)
    if (!(model_.nodeInertia[model_.freeBegin() + i] > 0)) refuse(model_.freeBegin() + i, "inertia");
  for (List& list : lists_)
    for (std::size_t k = 0; k < list.segment.size(); ++k) fill(list, k, slaveMass, slaveInertia);
}

double Islands::solve(const Ties& ties, const SegmentLoads& loads, double* a, double* z) {
  const int first = model_.freeBegin();
  for (int i : alone_.own) at(a, first + i) = at(loads.nodeForce, first + i) / model_.nodeMass[first + i];
  for (int i : alone_.ownTurning) at(z, first + i) = at(loads.nodeMoment, first + i) / model_.nodeInertia[first + i];
  const SegmentKernels& kernel = kernels();
  ties.each(static_cast<int>(pieces_.size()), [&](int k) {
    const Piece& part = pieces_[k];
    const List& list = lists_[part.list];
    const TieGroup& group = model_.groups[list.group];
    const TieView tie{group.coupling,    group.corners,      {0, group.segments()}, group.firstSlave,
                      group.node.data(), group.begin.data(), group.weight.data()};
    const std::size_t count = list.planes.size() / list.segment.size();
    const SegmentList segments{list.segment.data() + part.first,
                               part.count,
                               list.planes.data() + count * part.first,
                               list.mixed,
                               model_.freeBegin(),
                               model_.freeEnd()};
    SegmentLoads own = loads;
    if (own.rotation) own.rotation += 4 * ties.firstFrame(list.group);
    const auto run = list.kind == Kind::translation ? kernel.translation
                     : list.kind == Kind::pair      ? kernel.pair
                     : list.kind == Kind::many      ? kernel.many
                                                    : kernel.body;
    fastest_[k] = run(tie, ties.geometry(list.group), segments, own, a, z);
  });
  return std::accumulate(fastest_.begin(), fastest_.end(), 0.0, [](double x, double y) { return std::max(x, y); });
}

}  // namespace tiefmu
