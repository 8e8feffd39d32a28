// Slaves that springs or ports hold: where they are and how they move.
#pragma once

#include <vector>

#include "ties.hpp"

namespace tiefmu {

// Knows runs of segments, so that what a few springs hold costs little on a large surface. Arrays are 3 per slave of
// the model (spin: per turning slave) and valid for slaves on these segments only.
class AttachedSlaves {
 public:
  AttachedSlaves(const Model& model, Ties& ties);

  void updatePositions();                               // at the present geometry
  void updateMotion(const double* v, const double* w);  // from the nodes' velocities
  // Adds to the nodes' f, t the loads of these slaves.
  void distributeLoads(const double* force, const double* moment, double* f, double* t) const;

  const double* position() const { return xs_.data(); }  // m
  const double* velocity() const { return vs_.data(); }  // m/s
  const double* spin() const { return ws_.data(); }      // rad/s

 private:
  struct Run {
    std::size_t group;
    SegmentRange range;
  };
  const Model& model_;
  Ties& ties_;
  std::vector<Run> runs_;
  std::vector<double> xs_, vs_, ws_;  // empty where nothing is attached
};

}  // namespace tiefmu
