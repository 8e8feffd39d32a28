// The consistent mass matrix, factored.
#pragma once

#include <memory>

#include "inertia.hpp"

namespace tiefmu {

// L D L^T with an order of small fill, anew at every geometry that changes the matrix.
std::unique_ptr<ConsistentInertia> directInertia(const Model& model, const std::vector<int>& nodes);

}  // namespace tiefmu
