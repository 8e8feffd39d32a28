// A saved state of an instance, and the bytes in which it travels to another process.
#pragma once

#include <string>
#include <string_view>

#include "../src/simulation.hpp"
#include "state.hpp"

namespace tiefmu {

struct Clock {
  double time = 0, stop = 0;
  bool stopDefined = false;
};

struct SavedState {
  Simulation::State simulation;
  State state = State::instantiated;
  Clock clock;
};

// Bytes that are no state of this FMU. `what()` is one line.
struct StateError : std::runtime_error { using std::runtime_error::runtime_error; };

// The same state gives the same bytes, on every machine. `guid`: of the FMU.
std::size_t serializedSize(const SavedState& saved, const std::string& guid);
// Writes serializedSize bytes.
void serialize(const SavedState& saved, const std::string& guid, char* bytes, std::size_t size);
// Throws StateError for bytes of another origin, version or FMU, cut short or changed. `numbers`: how many the
// simulation's array holds. The places of input derivatives are left to the caller to check.
SavedState deserialize(std::string_view bytes, const std::string& guid, std::size_t numbers);

}  // namespace tiefmu
