// Each slave to the segment that holds it.
#pragma once

#include <vector>

#include "model.hpp"
#include "segment.hpp"

namespace tiefmu {

// One slave on its segment. Scene indices.
struct Bond {
  int slave, tie, segment;
  int corners;
  Coupling coupling;      // translation, until the formulation is looked at
  Projection projection;  // on the segment
  Vec3 offset;            // slave minus projection, m
};

// By tie, then in the order of the tie's slaves. Writes what the report says of it to the model: tie names, search
// distances, findings and dropped slaves. Throws SceneError where a slave is in two ties or is a master, or is not
// found and its tie does not drop such slaves.
std::vector<Bond> bindSlaves(const Scene& scene, Model& model);

}  // namespace tiefmu
