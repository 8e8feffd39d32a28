// Which inputs (and, in initialisation, which parameters) each unknown of the FMU depends on at one instant.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "variables.hpp"

namespace tiefmu {

// How a known enters: `constant` by a factor known at build time, `fixed` by a factor that only the fixed parameters
// change, `dependent` in any other way.
enum class Dependence : std::uint8_t { constant, fixed, dependent };

struct Dependency {
  std::uint32_t reference;  // of an input or a parameter
  Dependence kind;
};

// One row a value reference; rows of inputs and parameters are empty.
struct Dependencies {
  std::vector<std::size_t> begin;  // entries of value reference r: [begin[r], begin[r+1])
  std::vector<Dependency> entries;
  std::vector<std::uint8_t> all;  // 1: the unknown is taken to depend on every known; its row is empty
};

Dependencies dependencies(const Model& model, const std::vector<Block>& blocks);

}  // namespace tiefmu
