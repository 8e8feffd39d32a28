// What acts on slaves and nodes beside the tie: inputs, gravity, springs and ports.
#pragma once

#include <vector>

#include "port.hpp"
#include "spring_network.hpp"

namespace tiefmu {

class Loads {
 public:
  Loads(const Model& model, const Layout& layout, const double* data, AttachedSlaves& slaves, SpringNetwork& springs,
        Ports& ports);

  // At the present geometry, with the nodes' velocities v, w in the dampers.
  void gather(const double* v, const double* w);

  // Of the last gather: N and N m, 3 per slave, turning slave, node, rotating node. Pointers to the inputs themselves
  // where nothing adds to these.
  const double* slaveForce() const { return slaveForce_; }
  const double* slaveMoment() const { return slaveMoment_; }
  const double* nodeForce() const { return nodeForce_; }
  const double* nodeMoment() const { return nodeMoment_; }

 private:
  const double* field(Field f) const { return data_ + layout_[f].offset; }

  const Model& model_;
  const Layout& layout_;
  const double* data_;
  AttachedSlaves& slaves_;
  SpringNetwork& springs_;
  Ports& ports_;
  bool gravity_;
  std::vector<double> fs_, ms_, f_, t_;  // empty where the inputs are all there is
  const double *slaveForce_ = nullptr, *slaveMoment_ = nullptr, *nodeForce_ = nullptr, *nodeMoment_ = nullptr;
};

}  // namespace tiefmu
