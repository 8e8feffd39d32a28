// Where every number of a simulation stands.
#pragma once

#include <array>
#include <cstddef>

#include "model.hpp"

namespace tiefmu {

// Fields of the array, 3 doubles an entry for vectors. n: all nodes; r: rotating nodes; s: slaves; u: turning slaves;
// p, q: ports of driven nodes, of slaves.
enum class Field : int {
  // parameters
  timeStep,
  safety,
  threads,
  slaveMass /*s*/,
  slaveInertia /*u*/,
  // computed from the parameters at the end of initialisation
  addedMass /*n*/,
  addedInertia /*r*/,
  stiffness /*n*/,
  rotationalStiffness /*r*/,
  // inputs
  nodeForce /*3n*/,
  nodeMoment /*3r*/,
  slaveForce /*3s*/,
  slaveMoment /*3u*/,
  portForce /*3q*/,
  portMoment /*3q*/,
  portVelocity /*3p*/,
  portSpin /*3p*/,
  portAcceleration /*3p*/,
  portAngularAcceleration /*3p*/,
  // motion: inputs where a node is driven, states or results where it is free, zero where it is fixed
  acceleration /*3n*/,
  angularAcceleration /*3r*/,
  velocity /*3n*/,
  spin /*3r*/,
  position /*3n*/,
  // further states
  offset /*3u: d now*/,
  segmentRotation /*4 per meanMotion segment*/,
  orientation /*4 per Model::oriented*/,
  angle /*3r: integral of spin, where small displacements are integrated*/,
  portPlace /*3p: reference points*/,
  portRotation /*4p: since the start*/,
  work /*external, dissipated, total at the start, total at the end of the last step*/,
  lagged /*3n + 3r: velocity and spin that the last damping forces used*/,
  predicted /*3n + 3r: those that the last bias used*/,
  mode /*of the highest frequency: 3 per free unknown*/,
  bounds /*of the highest frequency, rad/s; of M^-1 C, 1/s; angle turned since the first was found, rad;
    the method's limit that follows from both, s*/
  ,
  // outputs
  slaveVelocity /*3s*/,
  slaveSpin /*3u*/,
  reactionForce /*3n*/,
  reactionMoment /*3r*/,
  slavePosition /*3s*/,
  slaveAcceleration /*3s*/,
  portReaction /*3p*/,
  portReactionMoment /*3p*/,
  portMeanVelocity /*3q*/,
  portMeanSpin /*3q*/,
  portPosition /*3(p + q)*/,
  energy /*kinetic, strain, dissipated, external, residual*/,
  powerResidual,
  drift,
  stableTimeStep,
  nodalTimeStep,
  count
};

struct Slice {
  std::size_t offset = 0, count = 0;  // in doubles; count 0: this model has no such field
};

// Where each field of a model stands in the array.
struct Layout {
  explicit Layout(const Model& model);
  Slice operator[](Field f) const { return slices[static_cast<int>(f)]; }
  std::size_t size = 0;
  std::array<Slice, static_cast<int>(Field::count)> slices{};
};

}  // namespace tiefmu
