// The consistent mass matrix of many free nodes, solved by conjugate gradients.
#pragma once

#include <memory>

#include "inertia.hpp"

namespace tiefmu {

// A system of any size, never assembled. Preconditioned by the nodes' own blocks, six freedoms at a time: the slaves'
// offsets couple a node's rotation with its translation firmly, but one node with the next as loosely as in any finite
// element mass matrix.
std::unique_ptr<ConsistentInertia> iterativeInertia(const Model& model, const std::vector<int>& nodes);

}  // namespace tiefmu
