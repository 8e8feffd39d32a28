#include "inertia_iterative.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "surface_solve.hpp"

namespace tiefmu {
namespace {

constexpr int maxIterations = 400;
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
  void finish(const Ties& ties, double tolerance, double* a, double* z) override;
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
    bool mean;
    std::vector<Part> parts;  // as the group's
  };

  // body(group, part), shared among threads.
  template <class Body> void eachPart(const Ties& ties, Body body);
  void addPart(const TieGroup& group, int first, int last, int nobody, Part& part) const;
  SurfacePart view(const Group& group, Part& part) const;
  // The sums of body(first, last) over blocks of fours of nodes.
  template <class Body> Sums overNodes(const Ties& ties, Body body);
  // product += T^T M_s T scaled. Returns scaled . T^T M_s T scaled.
  double multiply(const Ties& ties);
  Sums forget(const Ties& ties);
  [[noreturn]] void refuseOne() const;

  int width_, fours_;
  std::vector<Group> groups_;
  std::vector<double> own_, ownBlock_, block_, inverse_, x_, residual_, scaled_, product_, direction_, image_;
  std::vector<Sums> sums_;
  SurfaceVectors vectors_;
};

Iterative::Iterative(const Model& model, const std::vector<int>& nodes)
    : ConsistentInertia(model, nodes), width_(freeRotating_ > 0 ? 6 : 3), fours_((free_ + 3) / 4) {
  std::size_t mostParts = 0;
  for (std::size_t g = 0; g < model.groups.size(); ++g) {
    const TieGroup& group = model.groups[g];
    Group own{g, group.coupling == Coupling::meanMotion, {}};
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
  if (!mean) part.index = part.slave;
  part.firstSlave.push_back(slots);
  if (mean) {
    part.planes.resize(static_cast<std::size_t>(meanPlane::count) * part.index.size());
    return;
  }
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

void Iterative::prepare(const double* slaveMass, const double* slaveInertia) {
  for (Group& own : groups_) {
    const TieGroup& group = model_.groups[own.number];
    for (Part& part : own.parts)
      for (std::size_t k = 0; k < part.index.size(); ++k) {
        const int count = own.mean ? int{meanPlane::count} : int{shapePlane::count};
        double* base = &part.planes[k / 4 * 4 * count + k % 4];
        const auto plane = [&](int j) -> double& { return base[static_cast<std::ptrdiff_t>(4) * j]; };
        if (!own.mean) {
          const int s = part.index[k];
          plane(shapePlane::mass) = slaveMass[s];
          plane(shapePlane::inertia) = group.coupling == Coupling::rotation ? slaveInertia[s] : 0;
          continue;
        }
        if (static_cast<int>(k) >= part.segments) continue;
        const SlaveBody body = slaveBody(model_, group, part.index[k], slaveMass, slaveInertia);
        plane(meanPlane::mass) = body.mass;
        for (int j = 0; j < 3; ++j) plane(meanPlane::atStart + j) = body.moment[j];
        for (int j = 0; j < 6; ++j) plane(meanPlane::atStart + 3 + j) = body.inertia[j];
      }
  }
}

SurfacePart Iterative::view(const Group& group, Part& part) const {
  const int corners = model_.groups[group.number].corners;
  return {corners,
          width_,
          static_cast<int>(part.corner.size()) / (4 * corners),
          part.corner.data(),
          part.node.data(),
          part.firstSlave.data(),
          part.slave.data(),
          part.there.data(),
          part.planes.data()};
}

void Iterative::update(const InertiaGeometry& geometry) {
  geometry.ties.eachBlock(block_.size(), [&](std::size_t first, std::size_t last) {
    std::copy(ownBlock_.begin() + first, ownBlock_.begin() + last, block_.begin() + first);
  });
  eachPart(geometry.ties, [&](const Group& group, Part& part) {
    const bool turns = model_.groups[group.number].coupling == Coupling::rotation;
    const std::size_t frame = geometry.ties.firstFrame(group.number);
    const SurfaceShape shape{part.index.data(), turns ? geometry.offset : nullptr,
                             geometry.ties.frames().data() + frame,
                             geometry.rotation ? geometry.rotation + 4 * frame : nullptr};
    (group.mean ? kernels().prepareMean : kernels().prepareShapes)(view(group, part), shape, block_.data());
  });
  const Sums lost = overNodes(geometry.ties, [&](int first, int last) {
    return Sums{kernels().invert(width_, first, last, vectors_) ? 0.0 : 1.0, 0};
  });
  if (lost.first > 0) refuseOne();
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
  Sums sum{0, 0};
  for (const Sums& p : sums_) {
    sum.first += p.first;
    sum.second += p.second;
    sum.third += p.third;
  }
  return sum;
}

double Iterative::multiply(const Ties& ties) {
  eachPart(ties, [&](const Group& group, Part& part) {
    const auto run = group.mean ? kernels().multiplyMean : kernels().multiplyShapes;
    part.energy = run(view(group, part), scaled_.data(), product_.data());
  });
  double energy = 0;
  for (const Group& group : groups_)
    for (const Part& part : group.parts) energy += part.energy;
  return energy;
}

// Starts again from x = 0: the residual becomes the right side.
Sums Iterative::forget(const Ties& ties) {
  scaled_ = x_;
  for (std::size_t k = 0; k < product_.size(); ++k) product_[k] = own_[k] * scaled_[k];
  multiply(ties);
  for (std::size_t k = 0; k < 4 * static_cast<std::size_t>(width_ * fours_); ++k) residual_[k] += product_[k];
  std::fill(x_.begin(), x_.end(), 0.0);
  return overNodes(ties, [&](int first, int last) { return kernels().measure(width_, first, last, vectors_); });
}

double Iterative::leave(const Ties& ties, const SegmentLoads& loads, const double* offset, const double* a,
                        const double* z) {
  const int first = model_.freeBegin();
  const auto set = [&](int i, int k, const double* load, const double* acceleration) {
    const std::size_t p = static_cast<std::size_t>(width_) * i + k;
    const int node = first + node_[i];
    at(&x_[p], 0) = at(acceleration, node);
    at(&residual_[p], 0) = at(load, node) - own_[p] * at(acceleration, node);
  };
  ties.eachBlock(free_, [&](std::size_t begin, std::size_t end) {
    for (int i = static_cast<int>(begin); i < static_cast<int>(end); ++i) {
      set(i, 0, loads.nodeForce, a);
      if (i < freeRotating_) set(i, 3, loads.nodeMoment, z);
    }
  });
  const SurfaceKernels& kernel = kernels();
  eachPart(ties, [&](const Group& group, Part& part) {
    const SurfacePart seen = view(group, part);
    const bool turns = model_.groups[group.number].coupling == Coupling::rotation;
    SegmentLoads own = loads;
    if (!turns && !group.mean) own.velocity = nullptr;
    part.fastest = group.mean ? kernel.leaveMean(seen, offset, own, a, residual_.data())
                              : kernel.leaveShapes(seen, turns, offset, own, a, z, residual_.data());
  });
  double fastest = 0;
  for (const Group& group : groups_)
    for (const Part& part : group.parts) fastest = std::max(fastest, part.fastest);
  return fastest;
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
  finish(ties, tolerance, a, z);
}

// Conjugate gradients with one pass over the nodes and one over the segments an iteration [Chronopoulos & Gear 1989];
// preconditioned by the diagonal blocks.
void Iterative::finish(const Ties& ties, double tolerance, double* a, double* z) {
  for (std::vector<double>* v : {&direction_, &image_})
    ties.eachBlock(v->size(),
                   [&](std::size_t first, std::size_t last) { std::fill(v->begin() + first, v->begin() + last, 0.0); });
  for (std::vector<double>* v : {&product_, &residual_}) std::fill(v->begin() + 4 * width_ * fours_, v->end(), 0.0);
  const SurfaceKernels& kernel = kernels();
  Sums size = overNodes(ties, [&](int first, int last) { return kernel.measure(width_, first, last, vectors_); });
  if (!(size.first <= size.second)) size = forget(ties);
  if (!(size.second < HUGE_VAL)) {
    for (int i = 0; i < free_; ++i)
      at(a, model_.freeBegin() + node_[i]).setConstant(std::numeric_limits<double>::quiet_NaN());
    return;
  }
  // Beside nodes whose own mass is out of all proportion the others must not get lost.
  constexpr double rounding = 1e-15;
  const double target = std::max(tolerance * tolerance * size.third, rounding * rounding * size.second);
  Sums now = overNodes(ties, [&](int first, int last) { return kernel.start(width_, first, last, vectors_); });
  double alpha = 0, before = 0;
  for (int iteration = 0; iteration < maxIterations && now.first > target; ++iteration) {
    const double energy = now.second + multiply(ties);
    const double beta = iteration > 0 ? now.first / before : 0;
    const double curvature = iteration > 0 ? energy - beta * now.first / alpha : energy;
    if (!(curvature > 0)) break;  // rounding
    before = now.first;
    alpha = now.first / curvature;
    now = overNodes(ties,
                    [&](int first, int last) { return kernel.advance(width_, first, last, alpha, beta, vectors_); });
  }
  ties.eachBlock(free_, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const int node = model_.freeBegin() + node_[i];
      at(a, node) = at(&x_[width_ * i], 0);
      if (static_cast<int>(i) < freeRotating_) at(z, node) = at(&x_[width_ * i + 3], 0);
    }
  });
}

}  // namespace

std::unique_ptr<ConsistentInertia> iterativeInertia(const Model& model, const std::vector<int>& nodes) {
  return std::make_unique<Iterative>(model, nodes);
}

}  // namespace tiefmu
