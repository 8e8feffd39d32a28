// The functions of FMI 3.0 that a tie has no use for: types that no variable has, model exchange, scheduled execution,
// events, clocks, and structural parameters. Some importers look up every function of the standard before they read
// what the FMU offers, and give up on a missing one.
#include <cstdio>
#include <exception>

#include "fmi3_instance.hpp"

using namespace tiefmu;

namespace {

constexpr unsigned everyState = ~0u;

fmi3Status refuse(fmi3Instance c, const char* function, const char* why) noexcept {
  return fmi3::guard(c, Call{function, everyState}, [&](Fmi3Instance&) { throw Refused(why); });
}

// Only an empty call is right.
fmi3Status noVariables(fmi3Instance c, const char* function, size_t references, size_t values = 0) noexcept {
  return fmi3::guard(c, Call{function, everyState}, [&](Fmi3Instance&) {
    if (references > 0 || values > 0) throw Refused("there is no such variable that can be accessed so");
  });
}

constexpr const char* onlyCoSimulation = "only co-simulation is supported";
constexpr const char* noEvents = "there are no events and no clocks";
constexpr const char* noStructure = "there are no structural parameters";

fmi3Instance notInstantiated(fmi3LogMessageCallback log, fmi3InstanceEnvironment environment,
                             const char* line) noexcept {
  if (log) log(environment, fmi3Error, "logStatusError", line);
  return nullptr;
}

}  // namespace

extern "C" {

fmi3Instance fmi3InstantiateModelExchange(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  return notInstantiated(log, environment, "fmi3InstantiateModelExchange: only co-simulation is supported");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback, fmi3LockPreemptionCallback,
                                               fmi3UnlockPreemptionCallback) {
  return notInstantiated(log, environment, "fmi3InstantiateScheduledExecution: only co-simulation is supported");
}

fmi3Status fmi3GetFloat32(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3Float32*, size_t size) {
  return noVariables(c, "fmi3GetFloat32", n, size);
}

fmi3Status fmi3GetInt8(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3Int8*, size_t size) {
  return noVariables(c, "fmi3GetInt8", n, size);
}

fmi3Status fmi3GetUInt8(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3UInt8*, size_t size) {
  return noVariables(c, "fmi3GetUInt8", n, size);
}

fmi3Status fmi3GetInt16(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3Int16*, size_t size) {
  return noVariables(c, "fmi3GetInt16", n, size);
}

fmi3Status fmi3GetUInt16(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3UInt16*, size_t size) {
  return noVariables(c, "fmi3GetUInt16", n, size);
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3Int32*, size_t size) {
  return noVariables(c, "fmi3GetInt32", n, size);
}

fmi3Status fmi3GetUInt32(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3UInt32*, size_t size) {
  return noVariables(c, "fmi3GetUInt32", n, size);
}

fmi3Status fmi3GetUInt64(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3UInt64*, size_t size) {
  return noVariables(c, "fmi3GetUInt64", n, size);
}

fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3Boolean*, size_t size) {
  return noVariables(c, "fmi3GetBoolean", n, size);
}

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference*, size_t n, size_t*, fmi3Binary*, size_t size) {
  return noVariables(c, "fmi3GetBinary", n, size);
}

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference*, size_t n, fmi3Clock*) {
  return noVariables(c, "fmi3GetClock", n);
}

fmi3Status fmi3SetFloat32(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3Float32*, size_t size) {
  return noVariables(c, "fmi3SetFloat32", n, size);
}

fmi3Status fmi3SetInt8(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3Int8*, size_t size) {
  return noVariables(c, "fmi3SetInt8", n, size);
}

fmi3Status fmi3SetUInt8(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3UInt8*, size_t size) {
  return noVariables(c, "fmi3SetUInt8", n, size);
}

fmi3Status fmi3SetInt16(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3Int16*, size_t size) {
  return noVariables(c, "fmi3SetInt16", n, size);
}

fmi3Status fmi3SetUInt16(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3UInt16*, size_t size) {
  return noVariables(c, "fmi3SetUInt16", n, size);
}

fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3Int32*, size_t size) {
  return noVariables(c, "fmi3SetInt32", n, size);
}

fmi3Status fmi3SetUInt32(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3UInt32*, size_t size) {
  return noVariables(c, "fmi3SetUInt32", n, size);
}

fmi3Status fmi3SetUInt64(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3UInt64*, size_t size) {
  return noVariables(c, "fmi3SetUInt64", n, size);
}

fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3Boolean*, size_t size) {
  return noVariables(c, "fmi3SetBoolean", n, size);
}

fmi3Status fmi3SetInt64(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3Int64*, size_t size) {
  return noVariables(c, "fmi3SetInt64", n, size);
}

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3String*, size_t size) {
  return noVariables(c, "fmi3SetString", n, size);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference*, size_t n, const size_t*, const fmi3Binary*,
                         size_t size) {
  return noVariables(c, "fmi3SetBinary", n, size);
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference*, size_t n, const fmi3Clock*) {
  return noVariables(c, "fmi3SetClock", n);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) { return refuse(c, "fmi3EnterConfigurationMode", noStructure); }

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) { return refuse(c, "fmi3ExitConfigurationMode", noStructure); }

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference*, size_t, fmi3Float64*,
                                  fmi3IntervalQualifier*) {
  return refuse(c, "fmi3GetIntervalDecimal", noEvents);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference*, size_t, fmi3UInt64*, fmi3UInt64*,
                                   fmi3IntervalQualifier*) {
  return refuse(c, "fmi3GetIntervalFraction", noEvents);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference*, size_t, fmi3Float64*) {
  return refuse(c, "fmi3GetShiftDecimal", noEvents);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference*, size_t, fmi3UInt64*, fmi3UInt64*) {
  return refuse(c, "fmi3GetShiftFraction", noEvents);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance c, const fmi3ValueReference*, size_t, const fmi3Float64*) {
  return refuse(c, "fmi3SetIntervalDecimal", noEvents);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance c, const fmi3ValueReference*, size_t, const fmi3UInt64*,
                                   const fmi3UInt64*) {
  return refuse(c, "fmi3SetIntervalFraction", noEvents);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance c, const fmi3ValueReference*, size_t, const fmi3Float64*) {
  return refuse(c, "fmi3SetShiftDecimal", noEvents);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance c, const fmi3ValueReference*, size_t, const fmi3UInt64*,
                                const fmi3UInt64*) {
  return refuse(c, "fmi3SetShiftFraction", noEvents);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) { return refuse(c, "fmi3EvaluateDiscreteStates", noEvents); }

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*,
                                    fmi3Boolean*, fmi3Float64*) {
  return refuse(c, "fmi3UpdateDiscreteStates", noEvents);
}

fmi3Status fmi3EnterEventMode(fmi3Instance c) { return refuse(c, "fmi3EnterEventMode", noEvents); }

fmi3Status fmi3EnterStepMode(fmi3Instance c) { return refuse(c, "fmi3EnterStepMode", noEvents); }

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
  return refuse(c, "fmi3EnterContinuousTimeMode", onlyCoSimulation);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean, fmi3Boolean*, fmi3Boolean*) {
  return refuse(c, "fmi3CompletedIntegratorStep", onlyCoSimulation);
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64) { return refuse(c, "fmi3SetTime", onlyCoSimulation); }

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64*, size_t) {
  return refuse(c, "fmi3SetContinuousStates", onlyCoSimulation);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64*, size_t) {
  return refuse(c, "fmi3GetContinuousStateDerivatives", onlyCoSimulation);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64*, size_t) {
  return refuse(c, "fmi3GetEventIndicators", onlyCoSimulation);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64*, size_t) {
  return refuse(c, "fmi3GetContinuousStates", onlyCoSimulation);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64*, size_t) {
  return refuse(c, "fmi3GetNominalsOfContinuousStates", onlyCoSimulation);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t*) {
  return refuse(c, "fmi3GetNumberOfEventIndicators", onlyCoSimulation);
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t*) {
  return refuse(c, "fmi3GetNumberOfContinuousStates", onlyCoSimulation);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference, fmi3Float64) {
  return refuse(c, "fmi3ActivateModelPartition", onlyCoSimulation);
}

}  // extern "C"
