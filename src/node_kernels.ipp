// Loops over nodes that every step makes.
#pragma once

#include <cmath>
#include <cstddef>

#include "simd.hpp"

namespace tiefmu {
namespace {

void addScaled(std::size_t count, double h, const double* rate, double* value) {
  for (std::size_t k = 0; k < count; ++k) value[k] += h * rate[k];
}

void accelerate(std::size_t nodes, const double* load, const double* reaction, const double* mass, const double* added,
                double* acceleration) {
  for (std::size_t i = 0; i < nodes; ++i)
    store(acceleration + 3 * i, (tiefmu::load(load + 3 * i) + tiefmu::load(reaction + 3 * i)) / (mass[i] + added[i]));
}

bool within(std::size_t count, const double* value, double limit) {
  std::size_t outside = 0;
  for (std::size_t k = 0; k < count; ++k) outside += !(std::fabs(value[k]) < limit);  // counts NaN
  return outside == 0;
}

}  // namespace
}  // namespace tiefmu
