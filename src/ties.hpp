// The ties of one simulation: every group of the model at the present geometry, and the threads that share the work.
#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "layout.hpp"
#include "thread_pool.hpp"
#include "tie.hpp"

namespace tiefmu {

// Works on the array `data` laid out by `layout`. What it holds beside it (the segments' frames) follows from it.
class Ties {
 public:
  Ties(const Model& model, const Layout& layout, double* data);

  // As many threads as Field::threads says. Throws SceneError where that is no number of threads, or more than there
  // are.
  void startThreads();
  void stopThreads() { pool_.reset(); }

  // --- geometry
  void updateGeometry();       // frames and offsets at the present positions and rotations; finite rotations only
  void updateFramesAtStart();  // frames at the start positions, where small displacements keep them
  bool someCollapsed() const { return !noneCollapsed_; }  // since the last look
  // Node ids of a meanMotion segment whose nodes have come to lie on a line, so that its motion is not defined: "1, 2,
  // 3". Empty: none.
  std::string findCollapsedSegment();
  // Counts them; a mass matrix that was made at the same number is that of the present geometry.
  std::int64_t changes() const { return changes_; }
  const TieGeometry& geometry(std::size_t group) const { return geometry_[group]; }
  const std::vector<SegmentFrame>& frames() const { return frames_; }
  std::size_t firstFrame(std::size_t group) const { return firstFrame_[group]; }
  bool offsetsTurn() const { return offsetsTurn_; }  // in rotation groups, where they are states
  bool hasBias() const { return bias_; }             // slaves' accelerations have a part quadratic in velocities

  // --- the kernels of tie.hpp over all groups; arrays as there
  void mapMotion(const double* u, const double* turn, double* us, double* turns) const;
  void distributeLoads(const double* force, const double* moment, double* f, double* t) const;
  // Slaves' accelerations T q'' + b from the nodes' accelerations a, z and velocities v, w.
  void mapAccelerations(const double* a, const double* z, const double* v, const double* w, double* as,
                        double* zs) const;
  void addBias(const double* v, const double* w, double* as, double* zs) const;
  void placeSlaves(double* xs);  // m, 3 per slave
  // The same for some segments of one group, after `beginPlacing`.
  void beginPlacing();
  void placeSlaves(std::size_t group, SegmentRange range, double* xs);
  // Of the meanMotion segments (per group) but these, squared, (rad/s)^2.
  double largestSpin2(const double* v, const std::vector<std::vector<std::uint8_t>>& without) const;

  // --- motion: v, w of the nodes
  void move(double h, const double* v, const double* w);  // before the positions: offsets, rotations, frames over h
  void rates(const double* v, const double* w, double* offsetRate, double* rotationRate);  // per s; see Field
  void normaliseOffsets();  // of rotation groups, back to their length

  // body(first, last) over blocks of [0, count), shared among threads.
  template <class Body> void eachBlock(std::size_t count, Body body) const;
  // body(k) for each part k of a group, shared among threads. Parts of a phase touch no common node, so that sums do
  // not depend on who is first.
  template <class Body> void eachInPhases(const TieGroup& group, const Body& body) const;
  // body(k) for k in [0, count), shared among threads.
  template <class Body> void each(int count, const Body& body) const;
  // body(group, all its segments, geometry, index)
  template <class Body> void eachGroup(Body body) const;

 private:
  // As eachGroup, shared among threads: ranges that cover each group once. `body` may write what belongs to its
  // segments.
  template <class Body> void eachPart(Body body) const;
  template <class Body> void shareBlocks(std::size_t count, Body body) const;
  bool has(Field f) const { return layout_[f].count > 0; }
  double* field(Field f) const { return data_ + layout_[f].offset; }

  const Model& model_;
  const Layout& layout_;
  double* data_;
  std::vector<SegmentFrame> frames_;
  std::vector<std::size_t> firstFrame_;    // per group
  std::vector<TieGeometry> geometry_;      // per group
  std::vector<double> inverseLength2_;     // per turning slave: 1/d0^2, 1/m2
  std::vector<double> displacement_;       // small displacements: x - X, m
  std::vector<double> us_, turns_;         // scratch: slaves' displacements or velocities
  std::atomic<bool> noneCollapsed_{true};  // no kernel has met a collapsed segment since the last look
  std::unique_ptr<ThreadPool> pool_;       // none where one thread does it all
  std::int64_t changes_ = 0;
  bool offsetsTurn_ = false, shapeMoves_ = false, bias_ = false;
};

template <class Body> void Ties::eachGroup(Body body) const {
  for (std::size_t g = 0; g < model_.groups.size(); ++g)
    body(model_.groups[g], SegmentRange{0, model_.groups[g].segments()}, geometry(g), g);
}

template <class Body> void Ties::eachPart(Body body) const {
  if (!pool_) return eachGroup(body);
  for (std::size_t g = 0; g < model_.groups.size(); ++g) {
    const TieGroup& group = model_.groups[g];
    const std::vector<int>& end = group.partEnd;
    pool_->each(static_cast<int>(end.size()), [&](int k) {
      const int first = k == 0 ? 0 : end[k - 1], last = end[k];
      if (first < last) body(group, SegmentRange{first, last}, geometry(g), g);
    });
  }
}

template <class Body> void Ties::eachInPhases(const TieGroup& group, const Body& body) const {
  if (group.partEnd.size() == 1) return body(0);
  int first = 0;
  for (int last : group.phaseEnd) {
    each(last - first, [&](int k) { body(first + k); });
    first = last;
  }
}

template <class Body> void Ties::each(int count, const Body& body) const {
  if (pool_) return pool_->each(count, body);
  for (int k = 0; k < count; ++k) body(k);
}

template <class Body> void Ties::eachBlock(std::size_t count, Body body) const {
  if (!pool_) return body(std::size_t{0}, count);  // small, so that it is inlined
  shareBlocks(count, body);
}

template <class Body> void Ties::shareBlocks(std::size_t count, Body body) const {
  constexpr std::size_t smallest = 4096, most = 64;
  const std::size_t blocks = std::clamp<std::size_t>(count / smallest, 1, most);
  if (blocks == 1) return body(std::size_t{0}, count);
  pool_->each(static_cast<int>(blocks), [&](int k) { body(count * k / blocks, count * (k + 1) / blocks); });
}

}  // namespace tiefmu
