// The functions of model exchange. An FMU for co-simulation need not have them, but some importers look up every
// function of the standard before they read what the FMU offers, and give up on a missing one.
extern "C" {
#include "fmi2Functions.h"
}

#include <cstdio>

#include "instance.hpp"

namespace {

fmi2Status refuse(fmi2Component c, const char* function) noexcept {
  if (!c) return fmi2Error;
  char line[100];
  std::snprintf(line, sizeof line, "%s: only co-simulation is supported", function);
  static_cast<tiefmu::Instance*>(c)->log->write(tiefmu::Severity::error, tiefmu::Category::error, line);
  return fmi2Error;
}

}  // namespace

extern "C" {

fmi2Status fmi2EnterEventMode(fmi2Component c) { return refuse(c, "fmi2EnterEventMode"); }

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo*) { return refuse(c, "fmi2NewDiscreteStates"); }

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return refuse(c, "fmi2EnterContinuousTimeMode"); }

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean, fmi2Boolean*, fmi2Boolean*) {
  return refuse(c, "fmi2CompletedIntegratorStep");
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real) { return refuse(c, "fmi2SetTime"); }

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real[], size_t) {
  return refuse(c, "fmi2SetContinuousStates");
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real[], size_t) { return refuse(c, "fmi2GetDerivatives"); }

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real[], size_t) { return refuse(c, "fmi2GetEventIndicators"); }

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real[], size_t) { return refuse(c, "fmi2GetContinuousStates"); }

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real[], size_t) {
  return refuse(c, "fmi2GetNominalsOfContinuousStates");
}

}  // extern "C"
