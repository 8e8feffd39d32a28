// How far lumped inertia is from the true one.
#pragma once

#include <cstdint>
#include <optional>

#include "model.hpp"

namespace tiefmu {

struct LumpingError {
  double ratio;          // of lumped to true kinetic energy, the largest; infinite: a motion has no true energy
  std::int64_t segment;  // id of the one where it is
  bool connected;        // do segments share free masters, or else need a solution together?
};

// Over the motions of each segment's free masters, with the share of their own mass that the segment has of what is
// lumped onto them: both energies are sums over segments, so no motion of all masters has a larger ratio. Inertia at
// the start, theory (4.1), (4.2), (4.4). Nothing where no master is free or lumping is exact.
std::optional<LumpingError> lumpingError(const Model& model);

}  // namespace tiefmu
