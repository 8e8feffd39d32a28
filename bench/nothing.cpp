// The calls that the benchmark compares ours with: an FMU that checks nothing and does nothing, compiled with the same
// flags and called the same way.
#include <cstddef>

extern "C" {
#include "fmi2FunctionTypes.h"

#define EXPORT __attribute__((visibility("default")))

static double values[8];

EXPORT fmi2Status fmi2DoStep(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean) { return fmi2OK; }
EXPORT fmi2Status fmi2SetReal(fmi2Component, const fmi2ValueReference references[], size_t count,
                              const fmi2Real given[]) {
  for (size_t k = 0; k < count; ++k) values[references[k] & 7] = given[k];
  return fmi2OK;
}
EXPORT fmi2Status fmi2GetReal(fmi2Component, const fmi2ValueReference references[], size_t count, fmi2Real taken[]) {
  for (size_t k = 0; k < count; ++k) taken[k] = values[references[k] & 7];
  return fmi2OK;
}
}
