#include "inertia_iterative.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "surface_solve.hpp"

namespace tiefmu {
namespace {

constexpr int maxIterations = 400;
constexpr double digits = 1e-14;  // of small systems, whatever tolerance is asked for: there they cost little
constexpr int foursABlock = 512;  // of nodes that one thread takes; sums do not depend on how many there are

const SurfaceKernels& kernels() {
#ifdef TIEFMU_AVX2
  if (!usesBaselineKernels()) return avx2SurfaceKernels;
#endif
  return baselineSurfaceKernels;
}

// A symmetric 3x3 matrix xx xy xz yy yz zz with pivots above rounding.
bool positive(const double* m) {
  constexpr double lost = 1e-13;
  if (!(m[0] > 0)) return false;
  const double p1 = m[3] - m[1] * m[1] / m[0], l21 = (m[4] - m[1] * m[2] / m[0]) / p1;
  const double p2 = m[5] - m[2] * m[2] / m[0] - l21 * l21 * p1;
  return p1 > lost * m[3] && p2 > lost * m[5];
}

class Iterative : public ConsistentInertia {
 public:
  Iterative(const Model& model, const std::vector<int>& nodes);
  void prepare(const double* slaveMass, const double* slaveInertia) override;
  void update(const InertiaGeometry& geometry) override;
  double leave(const Ties& ties, const SegmentLoads& loads, const double* offset, const double* a,
               const double* z) override;
  bool start(const Ties& ties, const Along& along) override;
  Correction finish(const Ties& ties, double tolerance, double* a, double* z) override;
  void solve(const Ties& ties, double tolerance, const double* force, const double* moment, double* a,
             double* z) override;

 private:
  struct Part {  // see SurfacePart, SurfaceShape
    int segments = 0;
    std::vector<int> corner, node, firstSlave, slave, index;
    std::vector<double> there, planes;
    double energy = 0, fastest = 0;
  };
  struct Group {
    std::size_t number;
    Coupling coupling;
    std::vector<Part> parts;  // as the group's
  };

  // body(group, part), shared among threads.
  template <class Body> void eachPart(const Ties& ties, Body body);
  void addPart(const TieGroup& group, int first, int last, int nobody, Part& part) const;
  void addSegments(const TieGroup& group, const std::vector<int>& segments, int nobody, Part& part) const;
  SurfacePart view(const Group& group, Part& part) const;
  // The sums of body(first, last) over blocks of fours of nodes.
  template <class Body> Sums overNodes(const Ties& ties, Body body);
  // body(first, last) over blocks of nodes.
  template <class Body> void overEachNode(const Ties& ties, Body body);
  // product += T^T M_s T scaled. Returns scaled . T^T M_s T scaled.
  double multiply(const Ties& ties);
  [[noreturn]] void refuseOne() const;

  int width_, fours_;
  bool small_;
  std::vector<int> modelNode_;  // of each number
  SurfaceNodes nodes_;
  std::vector<Group> groups_;
  std::vector<double> own_, ownBlock_, block_, inverse_, x_, residual_, scaled_, product_, direction_, image_;
  std::vector<Sums> sums_;
  SurfaceVectors vectors_;
  Sums now_;
  double energyAlong_ = 0;
};

Iterative::Iterative(const Model& model, const std::vector<int>& nodes)
    : ConsistentInertia(model, nodes),
      width_(freeRotating_ > 0 ? 6 : 3),
      fours_((free_ + 3) / 4),
      small_(free_ + freeRotating_ <= smallSystem) {
  for (int i : node_) modelNode_.push_back(model.freeBegin() + i);
  nodes_ = {modelNode_.data(), freeRotating_};
  std::size_t mostParts = 0;
  for (std::size_t g = 0; g < model.groups.size(); ++g) {
    const TieGroup& group = model.groups[g];
    Group own{g, group.coupling, {}};
    int first = 0;
    for (int last : group.partEnd) {
      // Each part has a place of its own for corners that are not free: threads share none.
      const int nobody = 4 * fours_ + static_cast<int>(own.parts.size());
      addPart(group, first, last, nobody, own.parts.emplace_back());
      first = last;
    }
    mostParts = std::max(mostParts, own.parts.size());
    groups_.push_back(std::move(own));
  }
  const std::size_t places = 4 * static_cast<std::size_t>(fours_) + mostParts;
  for (auto* v : {&own_, &x_, &residual_, &scaled_, &product_, &direction_, &image_}) v->resize(width_ * places);
  block_.resize(nodeBlock::count * places);
  inverse_.resize(nodeBlock::count * places);
  ownBlock_.resize(nodeBlock::count * places);
  for (std::size_t i = 0; i < places; ++i) {
    const bool real = i < static_cast<std::size_t>(free_);
    const int node = real ? model.freeBegin() + node_[i] : 0;
    const double mass = real ? model.nodeMass[node] : 1;
    const double inertia = i < static_cast<std::size_t>(freeRotating_) ? model.nodeInertia[node] : 1;
    for (int k = 0; k < width_; ++k) own_[width_ * i + k] = k < 3 ? mass : inertia;
    double* block = &ownBlock_[nodeBlock::count * i];
    for (int k : {0, 3, 5}) {
      block[nodeBlock::translation + k] = mass;
      block[nodeBlock::rotation + k] = inertia;
    }
  }
  sums_.resize((fours_ + foursABlock - 1) / foursABlock);
  vectors_ = {x_.data(),     residual_.data(), scaled_.data(), product_.data(), direction_.data(),
              image_.data(), own_.data(),      block_.data(),  inverse_.data()};
}

void Iterative::addPart(const TieGroup& group, int first, int last, int nobody, Part& part) const {
  const int n = group.corners;
  const auto number = [&](int e, int corner) { return numberOf(group.node[static_cast<std::size_t>(n) * e + corner]); };
  std::vector<int> segments;
  for (int e = first; e < last; ++e) {
    bool here = false;
    for (int i = 0; i < n; ++i) here |= number(e, i) >= 0;
    if (here && group.begin[e] < group.begin[e + 1]) segments.push_back(e);
  }
  const int count = part.segments = static_cast<int>(segments.size());
  if (group.coupling == Coupling::translation) return addSegments(group, segments, nobody, part);
  const bool mean = group.coupling == Coupling::meanMotion;
  int slots = 0;
  for (int p = 0; p < count; p += 4) {
    int most = 0;
    for (int i = 0; i < n; ++i)
      for (int k = p; k < p + 4; ++k) {
        const int at = k < count ? number(segments[k], i) : -1;
        part.corner.push_back(at < 0 ? nobody : at);
        part.node.push_back(group.node[static_cast<std::size_t>(n) * segments[std::min(k, count - 1)] + i]);
      }
    for (int k = p; k < std::min(p + 4, count); ++k)
      most = std::max(most, group.begin[segments[k] + 1] - group.begin[segments[k]]);
    part.firstSlave.push_back(slots);
    slots += most;
    for (int s = 0; s < most; ++s)
      for (int k = p; k < p + 4; ++k) {
        const int e = segments[std::min(k, count - 1)];
        part.there.push_back(k < count && group.begin[e] + s < group.begin[e + 1]);
        part.slave.push_back(group.firstSlave + std::min(group.begin[e] + s, group.begin[e + 1] - 1));
      }
    if (mean)
      for (int k = p; k < p + 4; ++k) part.index.push_back(segments[std::min(k, count - 1)]);
  }
  part.firstSlave.push_back(slots);
  if (mean) {
    part.planes.resize(static_cast<std::size_t>(meanPlane::count) * part.index.size());
    return;
  }
  part.index = part.slave;
  // The weights: zero where a segment has no more slaves.
  part.planes.resize(static_cast<std::size_t>(shapePlane::count) * part.index.size());
  for (int p = 0; p < count; p += 4)
    for (int k = 0; k < 4 && p + k < count; ++k) {
      const int e = segments[p + k];
      for (int s = group.begin[e]; s < group.begin[e + 1]; ++s)
        for (int i = 0; i < n; ++i) {
          const int slot = part.firstSlave[p / 4] + s - group.begin[e];
          part.planes[4 * static_cast<std::size_t>(shapePlane::count * slot + shapePlane::weight + i) + k] =
              group.weight[static_cast<std::size_t>(n) * s + i];
        }
    }
}

void Iterative::addSegments(const TieGroup& group, const std::vector<int>& segments, int nobody, Part& part) const {
  part.index = segments;
  part.planes.resize(static_cast<std::size_t>(shareCount) * segments.size());
  for (int e : segments) {
    for (int i = 0; i < group.corners; ++i) {
      const int node = group.node[static_cast<std::size_t>(group.corners) * e + i], own = numberOf(node);
      part.node.push_back(node);
      part.corner.push_back(own < 0 ? nobody : own);
    }
    part.slave.push_back(group.firstSlave + group.begin[e]);
    part.slave.push_back(group.firstSlave + group.begin[e + 1]);
  }
}

void Iterative::prepare(const double* slaveMass, const double* slaveInertia) {
  for (Group& own : groups_) {
    const TieGroup& group = model_.groups[own.number];
    const std::size_t n = static_cast<std::size_t>(group.corners);
    for (Part& part : own.parts)
      for (std::size_t k = 0; k < part.index.size(); ++k) {
        const int index = part.index[k];
        if (own.coupling == Coupling::translation) {
          double* share = &part.planes[shareCount * k];
          for (std::size_t i = 0; i < n; ++i)
            for (std::size_t j = i; j < n; ++j) {
              double sum = 0;
              for (int s = part.slave[2 * k]; s < part.slave[2 * k + 1]; ++s) {
                const double* phi = &group.weight[n * static_cast<std::size_t>(s - group.firstSlave)];
                sum += slaveMass[s] * phi[i] * phi[j];
              }
              *share++ = sum;
            }
          continue;
        }
        const bool mean = own.coupling == Coupling::meanMotion;
        const int count = mean ? int{meanPlane::count} : int{shapePlane::count};
        double* base = &part.planes[k / 4 * 4 * count + k % 4];
        const auto plane = [&](int j) -> double& { return base[static_cast<std::ptrdiff_t>(4) * j]; };
        if (!mean) {
          plane(shapePlane::mass) = slaveMass[index];
          plane(shapePlane::inertia) = slaveInertia[index];
          continue;
        }
        if (static_cast<int>(k) >= part.segments) continue;
        const SlaveBody body = slaveBody(model_, group, index, slaveMass, slaveInertia);
        plane(meanPlane::mass) = body.mass;
        for (int j = 0; j < 3; ++j) plane(meanPlane::atStart + j) = body.moment[j];
        for (int j = 0; j < 6; ++j) plane(meanPlane::atStart + 3 + j) = body.inertia[j];
      }
  }
}

SurfacePart Iterative::view(const Group& group, Part& part) const {
  const TieGroup& of = model_.groups[group.number];
  const int corners = of.corners;
  return {corners,
          width_,
          of.coupling == Coupling::translation ? part.segments : (part.segments + 3) / 4,
          part.corner.data(),
          part.node.data(),
          part.firstSlave.data(),
          part.slave.data(),
          part.there.data(),
          part.planes.data(),
          of.weight.data() - static_cast<std::ptrdiff_t>(corners) * of.firstSlave};
}

void Iterative::update(const InertiaGeometry& geometry) {
  geometry.ties.eachBlock(block_.size(), [&](std::size_t first, std::size_t last) {
    std::copy(ownBlock_.begin() + first, ownBlock_.begin() + last, block_.begin() + first);
  });
  const SurfaceKernels& kernel = kernels();
  eachPart(geometry.ties, [&](const Group& group, Part& part) {
    const SurfacePart seen = view(group, part);
    if (group.coupling == Coupling::translation) return kernel.prepareShares(seen, block_.data());
    const std::size_t frame = geometry.ties.firstFrame(group.number);
    const SurfaceShape shape{part.index.data(), geometry.offset, geometry.ties.frames().data() + frame,
                             geometry.rotation ? geometry.rotation + 4 * frame : nullptr};
    (group.coupling == Coupling::meanMotion ? kernel.prepareMean : kernel.prepareShapes)(seen, shape, block_.data());
  });
  const Sums lost = overNodes(geometry.ties, [&](int first, int last) {
    return Sums{kernel.invert(width_, first, last, vectors_) ? 0.0 : 1.0};
  });
  if (lost.residual > 0) refuseOne();
}

void Iterative::refuseOne() const {
  for (int i = 0; i < free_; ++i)
    if (!positive(&block_[nodeBlock::count * static_cast<std::size_t>(i)])) refuse(i, false);
  for (int i = 0; i < freeRotating_; ++i)
    if (!positive(&block_[nodeBlock::count * static_cast<std::size_t>(i) + nodeBlock::rotation])) refuse(i, true);
  refuse(0, width_ == 6);
}

template <class Body> void Iterative::eachPart(const Ties& ties, Body body) {
  for (Group& group : groups_)
    ties.eachInPhases(model_.groups[group.number], [&](int k) { body(group, group.parts[k]); });
}

template <class Body> Sums Iterative::overNodes(const Ties& ties, Body body) {
  ties.each(static_cast<int>(sums_.size()),
            [&](int k) { sums_[k] = body(foursABlock * k, std::min(foursABlock * (k + 1), fours_)); });
  Sums sum;
  for (const Sums& p : sums_) {
    sum.residual += p.residual;
    sum.energy += p.energy;
    sum.size += p.size;
    sum.shared += p.shared;
    sum.along += p.along;
  }
  return sum;
}

template <class Body> void Iterative::overEachNode(const Ties& ties, Body body) {
  ties.eachBlock(free_,
                 [&](std::size_t first, std::size_t last) { body(static_cast<int>(first), static_cast<int>(last)); });
}

double Iterative::multiply(const Ties& ties) {
  const SurfaceKernels& kernel = kernels();
  eachPart(ties, [&](const Group& group, Part& part) {
    const auto run = group.coupling == Coupling::rotation     ? kernel.multiplyShapes
                     : group.coupling == Coupling::meanMotion ? kernel.multiplyMean
                                                              : kernel.multiplyShares;
    part.energy = run(view(group, part), scaled_.data(), product_.data());
  });
  double energy = 0;
  for (const Group& group : groups_)
    for (const Part& part : group.parts) energy += part.energy;
  return energy;
}

double Iterative::leave(const Ties& ties, const SegmentLoads& loads, const double* offset, const double* a,
                        const double* z) {
  const SurfaceKernels& kernel = kernels();
  overEachNode(ties, [&](int first, int last) { kernel.begin(width_, first, last, nodes_, loads, a, z, vectors_); });
  eachPart(ties, [&](const Group& group, Part& part) {
    const SurfacePart seen = view(group, part);
    part.fastest = group.coupling == Coupling::rotation
                       ? kernel.leaveShapes(seen, offset, loads, a, z, residual_.data())
                   : group.coupling == Coupling::meanMotion ? kernel.leaveMean(seen, offset, loads, a, residual_.data())
                                                            : kernel.leaveShares(seen, loads, a, residual_.data());
  });
  double fastest = 0;
  for (const Group& group : groups_)
    for (const Part& part : group.parts) fastest = std::max(fastest, part.fastest);
  return fastest;
}

bool Iterative::start(const Ties& ties, const Along& along) {
  const SurfaceKernels& kernel = kernels();
  for (std::vector<double>* v : {&product_, &residual_}) std::fill(v->begin() + 4 * width_ * fours_, v->end(), 0.0);
  energyAlong_ = along.energy;
  if (energyAlong_ > 0)
    overEachNode(ties, [&](int first, int last) {
      kernel.take(width_, first, last, nodes_, along.a, along.z, direction_.data());
    });
  now_ = overNodes(ties,
                   [&](int first, int last) { return kernel.start(width_, first, last, energyAlong_ > 0, vectors_); });
  return now_.residual <= now_.size;
}

void Iterative::solve(const Ties& ties, double tolerance, const double* force, const double* moment, double* a,
                      double* z) {
  const int first = model_.freeBegin();
  std::fill(x_.begin(), x_.end(), 0.0);
  for (int i = 0; i < free_; ++i) {
    const std::size_t p = static_cast<std::size_t>(width_) * i;
    at(&residual_[p], 0) = at(force, first + node_[i]);
    if (i < freeRotating_) at(&residual_[p + 3], 0) = at(moment, first + node_[i]);
  }
  start(ties, {});
  finish(ties, tolerance, a, z);
}

// Conjugate gradients with one pass over the nodes and one over the segments an iteration [Chronopoulos & Gear 1989];
// preconditioned by the diagonal blocks. The first direction is the one given where that takes most of the residual
// [Fischer 1998].
Correction Iterative::finish(const Ties& ties, double tolerance, double* a, double* z) {
  const SurfaceKernels& kernel = kernels();
  const int first = model_.freeBegin();
  if (!(now_.size < HUGE_VAL)) {
    for (int i : node_) at(a, first + i).setConstant(std::numeric_limits<double>::quiet_NaN());
    return {now_.residual, 0};
  }
  // Beside nodes whose own mass is out of all proportion the others must not get lost.
  constexpr double rounding = 1e-15;
  if (small_) tolerance = std::min(tolerance, digits);
  const double target = std::max(tolerance * tolerance * now_.shared, rounding * rounding * now_.size);
  Correction correction{now_.residual, 0};
  Sums now = now_;
  const auto advance = [&](double alpha, double beta) {
    now =
        overNodes(ties, [&](int begin, int end) { return kernel.advance(width_, begin, end, alpha, beta, vectors_); });
  };
  constexpr double most = 0.4;  // of the error's energy, about
  if (now.residual > target && now.along * now.along > most * energyAlong_ * now.residual) {
    const double energy =
        overNodes(ties, [&](int begin, int end) { return Sums{0, kernel.turn(width_, begin, end, vectors_)}; }).energy +
        multiply(ties);
    if (energy > 0) {
      const double alpha = now.along / energy;
      correction.energy += alpha * now.along;
      advance(alpha, 0);
    }
  }
  double alpha = 0, before = 0;
  for (int iteration = 0; iteration < maxIterations && now.residual > target; ++iteration) {
    const double energy = now.energy + multiply(ties);
    const double beta = iteration > 0 ? now.residual / before : 0;
    const double curvature = iteration > 0 ? energy - beta * now.residual / alpha : energy;
    if (!(curvature > 0)) break;  // rounding
    before = now.residual;
    alpha = now.residual / curvature;
    correction.energy += alpha * now.residual;
    advance(alpha, beta);
  }
  overEachNode(ties, [&](int begin, int end) { kernel.give(width_, begin, end, nodes_, x_.data(), a, z); });
  return correction;
}

}  // namespace

std::unique_ptr<ConsistentInertia> iterativeInertia(const Model& model, const std::vector<int>& nodes) {
  return std::make_unique<Iterative>(model, nodes);
}

}  // namespace tiefmu
