// The states of an instance that the co-simulation of every standard knows. Which function may be called in which state
// is the matter of each standard's functions.
#pragma once

namespace tiefmu {

enum class State : unsigned {  // bits; the numbers stand in serialised states
  instantiated = 1,
  initialization = 2,
  stepComplete = 4,
  inStep = 8,  // in a call back to the importer from the middle of a step
  terminated = 64,
  error = 128,
};

}  // namespace tiefmu
