#include "ties.hpp"

#include <cmath>
#include <system_error>

#include "text.hpp"

namespace tiefmu {

Ties::Ties(const Model& model, const Layout& layout, double* data) : model_(model), layout_(layout), data_(data) {
  const std::size_t s = model.slaves(), u = model.turning();
  for (const TieGroup& group : model.groups) {
    firstFrame_.push_back(frames_.size());
    if (kinematicsOf(group.coupling).segmentsTurn) frames_.resize(frames_.size() + group.segments());
  }
  // Offsets of translation couplings never turn, so they have no place in the state.
  for (std::size_t g = 0; g < model.groups.size(); ++g)
    geometry_.push_back(
        {kinematicsOf(model.groups[g].coupling).slavesTurn ? field(Field::offset) : model.slaveOffset.data(),
         frames_.data() + firstFrame_[g]});
  inverseLength2_.resize(u);
  for (std::size_t j = 0; j < u; ++j) {
    const double length2 = at(model.slaveOffset.data(), j).squaredNorm();
    inverseLength2_[j] = length2 > 0 ? 1 / length2 : 0;
    offsetsTurn_ |= model.finite() && length2 > 0;
  }
  shapeMoves_ = offsetsTurn_ || !frames_.empty();
  bias_ = model.finite() && u > 0;
  const bool small = has(Field::position) && !model.finite();
  if (small) displacement_.resize(3 * static_cast<std::size_t>(model.nodes()));
  if (small || (model.settings.method == Method::rk4 && model.anyFree())) {
    us_.resize(3 * s);
    turns_.resize(3 * u);
  }
}

void Ties::startThreads() {
  const double threads = *field(Field::threads);
  if (!(threads >= 1 && threads <= mostThreads && threads == std::floor(threads)))
    throw SceneError("integrator.threads is " + text(threads) + "; it must be a whole number from 1 to " +
                     std::to_string(mostThreads));
  const int wanted = model_.shareable() ? static_cast<int>(threads) : 1;
  if (wanted == (pool_ ? pool_->threads() : 1)) return;
  pool_.reset();
  if (wanted == 1) return;
  try {
    pool_ = std::make_unique<ThreadPool>(wanted);
  } catch (const std::system_error& e) {
    throw SceneError("integrator.threads is " + text(threads) + ", more than the system gives: " + e.what());
  }
}

void Ties::updateFramesAtStart() {
  ++changes_;
  eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry, std::size_t g) {
    if (group.coupling == Coupling::meanMotion)
      if (!updateFrames(group, range, model_.nodePosition.data(), frames_.data() + firstFrame_[g]))
        noneCollapsed_ = false;
  });
}

void Ties::updateGeometry() {
  ++changes_;
  if (!model_.finite()) return;
  eachPart([&](const TieGroup& group, SegmentRange range, TieGeometry, std::size_t g) {
    if (group.coupling != Coupling::meanMotion) return;
    if (has(Field::position) && !updateFrames(group, range, field(Field::position), frames_.data() + firstFrame_[g]))
      noneCollapsed_ = false;
    if (has(Field::segmentRotation))
      rotateOffsets(group, range, field(Field::segmentRotation) + 4 * firstFrame_[g], model_.slaveOffset.data(),
                    field(Field::offset));
  });
}

std::string Ties::findCollapsedSegment() {
  if (noneCollapsed_) return {};
  std::size_t k = 0;
  const double* rotation = has(Field::segmentRotation) ? field(Field::segmentRotation) : nullptr;
  for (const TieGroup& group : model_.groups) {
    if (group.coupling != Coupling::meanMotion) continue;
    for (int e = 0; e < group.segments(); ++e, ++k) {
      const double* m = frames_[k].inverse;
      double sum = m[0] + m[1] + m[2] + m[4] + m[5] + m[8];
      if (rotation) sum += rotation[4 * k] + rotation[4 * k + 1] + rotation[4 * k + 2] + rotation[4 * k + 3];
      if (std::isfinite(sum)) continue;
      std::string ids;
      for (int i = 0; i < group.corners; ++i)
        ids += (i ? ", " : "") + std::to_string(model_.nodeId[group.node[group.corners * e + i]]);
      return ids;
    }
  }
  noneCollapsed_ = true;
  return {};
}

void Ties::mapMotion(const double* u, const double* turn, double* us, double* turns) const {
  eachPart([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    tiefmu::mapMotion(group, range, shape, u, turn, us, turns);
  });
}

void Ties::distributeLoads(const double* force, const double* moment, double* f, double* t) const {
  for (std::size_t g = 0; g < model_.groups.size(); ++g) {
    const TieGroup& group = model_.groups[g];
    const auto part = [&](int first, int last) {
      tiefmu::distributeLoads(group, {first, last}, geometry(g), force, moment, f, t);
    };
    const std::vector<int>& end = group.partEnd;
    eachInPhases(group, [&](int k) { part(k == 0 ? 0 : end[k - 1], end[k]); });
  }
}

void Ties::mapAccelerations(const double* a, const double* z, const double* v, const double* w, double* as,
                            double* zs) const {
  eachPart([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    tiefmu::mapMotion(group, range, shape, a, z, as, zs);
    if (bias_) tiefmu::addBias(group, range, shape, v, w, as, zs);
  });
}

void Ties::addBias(const double* v, const double* w, double* as, double* zs) const {
  if (!bias_) return;
  eachPart([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
    tiefmu::addBias(group, range, shape, v, w, as, zs);
  });
}

void Ties::beginPlacing() {
  const double* x = field(Field::position);
  for (std::size_t k = 0; k < displacement_.size(); ++k) displacement_[k] = x[k] - model_.nodePosition[k];
}

// In small displacements positions are what the frozen T makes of the nodes'.
void Ties::placeSlaves(std::size_t g, SegmentRange range, double* xs) {
  const TieGroup& group = model_.groups[g];
  const TieGeometry shape = geometry(g);
  if (model_.finite()) return place(group, range, shape, field(Field::position), xs);
  // x_s = X_s + T (x - X): the start position, then the displacement on top.
  tiefmu::mapMotion(group, range, shape, displacement_.data(), field(Field::angle), us_.data(), turns_.data());
  place(group, range, shape, model_.nodePosition.data(), xs);
  for (int k = 3 * (group.firstSlave + group.begin[range.first]); k < 3 * (group.firstSlave + group.begin[range.last]);
       ++k)
    xs[k] += us_[k];
}

void Ties::placeSlaves(double* xs) {
  beginPlacing();
  eachPart([&](const TieGroup&, SegmentRange range, TieGeometry, std::size_t g) { placeSlaves(g, range, xs); });
}

double Ties::largestSpin2(const double* v, const std::vector<std::vector<std::uint8_t>>& without) const {
  double largest = 0;
  eachGroup([&](const TieGroup& group, SegmentRange, TieGeometry shape, std::size_t g) {
    if (group.coupling != Coupling::meanMotion) return;
    for (int e = 0; e < group.segments(); ++e) {
      if (without[g][e]) continue;
      Vec3 spin;
      meanSpin(group, {e, e + 1}, shape.frame, v, spin.data() - 3 * static_cast<std::ptrdiff_t>(e));
      largest = std::max(largest, spin.squaredNorm());
    }
  });
  return largest;
}

void Ties::move(double h, const double* v, const double* w) {
  ++changes_;
  if (!shapeMoves_) return;
  const bool turns = has(Field::segmentRotation);
  eachPart([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t g) {
    if (group.coupling == Coupling::rotation && offsetsTurn_)
      turnOffsets(group, range, h, w, inverseLength2_.data(), field(Field::offset));
    if (group.coupling != Coupling::meanMotion) return;
    double* q = turns ? field(Field::segmentRotation) + 4 * firstFrame_[g] : nullptr;
    if (model_.finite()) {
      if (!moveSegments(group, range, h, field(Field::position), v, frames_.data() + firstFrame_[g], q))
        noneCollapsed_ = false;
      if (turns) rotateOffsets(group, range, q, model_.slaveOffset.data(), field(Field::offset));
    } else if (turns) {
      for (int e = range.first; e < range.last; ++e) {
        Vec3 spin;
        meanSpin(group, {e, e + 1}, shape.frame, v, spin.data() - 3 * static_cast<std::ptrdiff_t>(e));
        turnQuaternion(q + 4 * static_cast<std::ptrdiff_t>(e), h * spin);
      }
    }
  });
}

void Ties::rates(const double* v, const double* w, double* offsetRate, double* rotationRate) {
  if (offsetsTurn_)
    eachGroup([&](const TieGroup& group, SegmentRange range, TieGeometry shape, std::size_t) {
      if (group.coupling != Coupling::rotation) return;
      tiefmu::mapMotion(group, range, shape, v, w, us_.data(), turns_.data());
      for (int s = group.firstSlave; s < group.firstSlave + group.slaves(); ++s)
        at(offsetRate, s) = at(turns_.data(), s).cross(at(shape.offset, s));
    });
  if (has(Field::segmentRotation))
    eachGroup([&](const TieGroup& group, SegmentRange, TieGeometry shape, std::size_t g) {
      if (group.coupling != Coupling::meanMotion) return;
      for (int e = 0; e < group.segments(); ++e) {
        Vec3 spin;
        meanSpin(group, {e, e + 1}, shape.frame, v, spin.data() - 3 * static_cast<std::ptrdiff_t>(e));
        const std::size_t k = 4 * (firstFrame_[g] + e);
        quaternionRate(field(Field::segmentRotation) + k, spin, rotationRate + k);
      }
    });
}

void Ties::normaliseOffsets() {
  ++changes_;
  if (!offsetsTurn_) return;
  for (const TieGroup& group : model_.groups) {
    if (group.coupling != Coupling::rotation) continue;
    for (int s = group.firstSlave; s < group.firstSlave + group.slaves(); ++s)
      if (inverseLength2_[s] > 0)
        at(field(Field::offset), s) /= std::sqrt(at(field(Field::offset), s).squaredNorm() * inverseLength2_[s]);
  }
}

}  // namespace tiefmu
