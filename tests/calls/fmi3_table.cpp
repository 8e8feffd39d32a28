// FMI 3.0: one of each call with good arguments, and which states they are allowed in, by sections 2.3 and 4.2.
#include "memory.hpp"
#include "session.hpp"

extern "C" {
#include "fmi3Functions.h"
}

namespace {

void keep(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
  const memory::Pause pause;
  static_cast<Session*>(environment)->log.push_back({status, category, message});
}

// Loads in, outputs out, in the middle of a step; and what is not allowed there.
void update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean, fmi3Boolean, fmi3Boolean,
            fmi3Boolean canReturn, fmi3Boolean* returns, fmi3Float64* until) {
  Session& s = *static_cast<Session*>(environment);
  const Packed& p = s.packed;
  if (s.intrudes) {
    const std::size_t messages = s.log.size();
    require(fmi3Terminate(s.component) == fmi3Error && fmi3Reset(s.component) == fmi3Error &&
                fmi3GetFMUState(s.component, &s.saved[0]) == fmi3Error &&
                fmi3DoStep(s.component, time, 1, fmi3True, nullptr, nullptr, nullptr, nullptr) == fmi3Error &&
                fmi3GetAdjointDerivative(s.component, nullptr, 0, nullptr, 0, nullptr, 0, nullptr, 0) == fmi3Error,
            "allowed in the middle of a step");
    s.log.erase(s.log.begin() + static_cast<std::ptrdiff_t>(messages), s.log.end());
  }
  fmi3SetFloat64(s.component, p.inputs.data(), p.inputs.size(), s.set.data(), s.set.size());
  fmi3GetFloat64(s.component, p.readable.data(), p.readable.size(), s.read.data(), s.read.size());
  if (!canReturn || time < s.returns) return;
  *returns = fmi3True;
  *until = time;
}

void instantiate(Session& s, const char* token, bool logging) {
  s.component = fmi3InstantiateCoSimulation("session", token, s.packed.path.c_str(), fmi3False, logging, fmi3False,
                                            s.asks, nullptr, 0, &s, keep, s.asks ? update : nullptr);
}

int step(Session& s, double time, double size) {
  fmi3Boolean event = fmi3True, over = fmi3True, early = fmi3True;
  s.end = -1;
  const fmi3Status status = fmi3DoStep(s.component, time, size, fmi3True, &event, &over, &early, &s.end);
  require(status != fmi3OK || (!event && !over && early == (s.end != time + size)), "flags of a step");
  return status;
}

int setDebugLogging(Session& s) { return fmi3SetDebugLogging(s.component, fmi3False, 0, nullptr); }
int enterInitializationMode(Session& s) {
  return fmi3EnterInitializationMode(s.component, fmi3False, 0, 0, fmi3True, 100);
}
int exitInitializationMode(Session& s) { return fmi3ExitInitializationMode(s.component); }
int terminate(Session& s) { return fmi3Terminate(s.component); }
int reset(Session& s) { return fmi3Reset(s.component); }

int getFloat64(Session& s) {
  const References& all = s.packed.readable;
  const int status = fmi3GetFloat64(s.component, all.data(), all.size(), s.read.data(), s.read.size());
  s.give(s.read);
  return status;
}
int setInputs(Session& s, const Values& values) {
  const References& inputs = s.packed.inputs;
  return fmi3SetFloat64(s.component, inputs.data(), inputs.size(), values.data(), values.size());
}
int setFloat64(Session& s) { return setInputs(s, s.set); }

int getNumberOfDependencies(Session& s) {
  std::size_t count = 0;
  const int status = fmi3GetNumberOfVariableDependencies(s.component, s.packed.outputs[0], &count);
  s.give(&count, sizeof count);
  return status;
}
int getDependencies(Session& s) {  // of an input: there are none
  return fmi3GetVariableDependencies(s.component, s.packed.inputs[0], nullptr, nullptr, nullptr, nullptr, 0);
}
template <auto function> int derivative(Session& s, const Values& seed, Values& result) {
  const Packed& p = s.packed;
  const int status = function(s.component, p.outputs.data(), p.outputs.size(), p.inputs.data(), p.inputs.size(),
                              seed.data(), seed.size(), result.data(), result.size());
  s.give(result);
  return status;
}
int getDirectionalDerivative(Session& s) { return derivative<fmi3GetDirectionalDerivative>(s, s.change, s.changes); }
int getAdjointDerivative(Session& s) { return derivative<fmi3GetAdjointDerivative>(s, s.weights, s.gradient); }
int getOutputDerivatives(Session& s) {
  const Packed& p = s.packed;
  const int status = fmi3GetOutputDerivatives(s.component, p.outputs.data(), p.outputs.size(), s.orders.data(),
                                              s.changes.data(), s.changes.size());
  s.give(s.changes);
  return status;
}
// Long enough for an importer to be asked, where one wants that.
int doStep(Session& s) { return step(s, 0, s.asks ? 1.3 : 0.01); }

// What no variable has: only an empty call is right.
template <auto function> int empty(Session& s) { return function(s.component, nullptr, 0, nullptr, 0); }
template <auto function> int emptyClocks(Session& s) { return function(s.component, nullptr, 0, nullptr); }
template <auto function> int emptyBinary(Session& s) { return function(s.component, nullptr, 0, nullptr, nullptr, 0); }

// What this FMU does not have.
template <auto function> int alone(Session& s) { return function(s.component); }
template <auto function> int number(Session& s) { return function(s.component, nullptr); }
template <auto function> int vector(Session& s) { return function(s.component, nullptr, 0); }
int getIntervalFraction(Session& s) {
  return fmi3GetIntervalFraction(s.component, nullptr, 0, nullptr, nullptr, nullptr);
}
int getIntervalDecimal(Session& s) { return fmi3GetIntervalDecimal(s.component, nullptr, 0, nullptr, nullptr); }
int getShiftFraction(Session& s) { return fmi3GetShiftFraction(s.component, nullptr, 0, nullptr, nullptr); }
int setIntervalFraction(Session& s) { return fmi3SetIntervalFraction(s.component, nullptr, 0, nullptr, nullptr); }
int setShiftFraction(Session& s) { return fmi3SetShiftFraction(s.component, nullptr, 0, nullptr, nullptr); }
int updateDiscreteStates(Session& s) {
  return fmi3UpdateDiscreteStates(s.component, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr);
}
int completedIntegratorStep(Session& s) {
  return fmi3CompletedIntegratorStep(s.component, fmi3False, nullptr, nullptr);
}
int setTime(Session& s) { return fmi3SetTime(s.component, 1); }
int activateModelPartition(Session& s) { return fmi3ActivateModelPartition(s.component, 0, 1); }

}  // namespace

//                                        Instantiated
//                                        | Initialization Mode
//                                        | | Step Mode
//                                        | | | Terminated
//                                        | | | | error
const Standard fmi3{
    {"Instantiated", "Initialization Mode", "Step Mode", "Terminated", "error"},
    {
        {"fmi3SetDebugLogging", "x x x x x", setDebugLogging},
        {"fmi3EnterInitializationMode", "x . . . .", enterInitializationMode},
        {"fmi3ExitInitializationMode", ". x . . .", exitInitializationMode},
        {"fmi3Terminate", ". . x . .", terminate},
        {"fmi3Reset", "x x x x x", reset},
        {"fmi3GetFloat64", ". x x x x", getFloat64},
        {"fmi3GetInt64", ". x x x x", empty<fmi3GetInt64>},
        {"fmi3GetString", ". x x x x", empty<fmi3GetString>},
        {"fmi3SetFloat64", "x x x . .", setFloat64},
        {"fmi3GetFMUState", "x x x x x", getState},
        {"fmi3SetFMUState", "x x x x x", setState},
        {"fmi3FreeFMUState", "x x x x x", freeState},
        {"fmi3SerializedFMUStateSize", "x x x x x", serializedSize},
        {"fmi3SerializeFMUState", "x x x x x", serialize},
        {"fmi3DeserializeFMUState", "x x x x x", deserialize},
        {"fmi3GetNumberOfVariableDependencies", "x x x x x", getNumberOfDependencies},
        {"fmi3GetVariableDependencies", "x x x x x", getDependencies},
        {"fmi3GetDirectionalDerivative", ". x x x x", getDirectionalDerivative},
        {"fmi3GetAdjointDerivative", ". x x x x", getAdjointDerivative},
        {"fmi3GetOutputDerivatives", ". . x x x", getOutputDerivatives},
        {"fmi3DoStep", ". . x . .", doStep},
        {"fmi3GetFloat32", "x x x x x", empty<fmi3GetFloat32>},
        {"fmi3GetInt8", "x x x x x", empty<fmi3GetInt8>},
        {"fmi3GetUInt8", "x x x x x", empty<fmi3GetUInt8>},
        {"fmi3GetInt16", "x x x x x", empty<fmi3GetInt16>},
        {"fmi3GetUInt16", "x x x x x", empty<fmi3GetUInt16>},
        {"fmi3GetInt32", "x x x x x", empty<fmi3GetInt32>},
        {"fmi3GetUInt32", "x x x x x", empty<fmi3GetUInt32>},
        {"fmi3GetUInt64", "x x x x x", empty<fmi3GetUInt64>},
        {"fmi3GetBoolean", "x x x x x", empty<fmi3GetBoolean>},
        {"fmi3GetBinary", "x x x x x", emptyBinary<fmi3GetBinary>},
        {"fmi3GetClock", "x x x x x", emptyClocks<fmi3GetClock>},
        {"fmi3SetFloat32", "x x x x x", empty<fmi3SetFloat32>},
        {"fmi3SetInt8", "x x x x x", empty<fmi3SetInt8>},
        {"fmi3SetUInt8", "x x x x x", empty<fmi3SetUInt8>},
        {"fmi3SetInt16", "x x x x x", empty<fmi3SetInt16>},
        {"fmi3SetUInt16", "x x x x x", empty<fmi3SetUInt16>},
        {"fmi3SetInt32", "x x x x x", empty<fmi3SetInt32>},
        {"fmi3SetUInt32", "x x x x x", empty<fmi3SetUInt32>},
        {"fmi3SetInt64", "x x x x x", empty<fmi3SetInt64>},
        {"fmi3SetUInt64", "x x x x x", empty<fmi3SetUInt64>},
        {"fmi3SetBoolean", "x x x x x", empty<fmi3SetBoolean>},
        {"fmi3SetString", "x x x x x", empty<fmi3SetString>},
        {"fmi3SetBinary", "x x x x x", emptyBinary<fmi3SetBinary>},
        {"fmi3SetClock", "x x x x x", emptyClocks<fmi3SetClock>},
        {"fmi3EnterConfigurationMode", ". . . . .", alone<fmi3EnterConfigurationMode>},
        {"fmi3ExitConfigurationMode", ". . . . .", alone<fmi3ExitConfigurationMode>},
        {"fmi3GetIntervalDecimal", ". . . . .", getIntervalDecimal},
        {"fmi3GetIntervalFraction", ". . . . .", getIntervalFraction},
        {"fmi3GetShiftDecimal", ". . . . .", emptyClocks<fmi3GetShiftDecimal>},
        {"fmi3GetShiftFraction", ". . . . .", getShiftFraction},
        {"fmi3SetIntervalDecimal", ". . . . .", emptyClocks<fmi3SetIntervalDecimal>},
        {"fmi3SetIntervalFraction", ". . . . .", setIntervalFraction},
        {"fmi3SetShiftDecimal", ". . . . .", emptyClocks<fmi3SetShiftDecimal>},
        {"fmi3SetShiftFraction", ". . . . .", setShiftFraction},
        {"fmi3EvaluateDiscreteStates", ". . . . .", alone<fmi3EvaluateDiscreteStates>},
        {"fmi3UpdateDiscreteStates", ". . . . .", updateDiscreteStates},
        {"fmi3EnterEventMode", ". . . . .", alone<fmi3EnterEventMode>},
        {"fmi3EnterStepMode", ". . . . .", alone<fmi3EnterStepMode>},
        {"fmi3EnterContinuousTimeMode", ". . . . .", alone<fmi3EnterContinuousTimeMode>},
        {"fmi3CompletedIntegratorStep", ". . . . .", completedIntegratorStep},
        {"fmi3SetTime", ". . . . .", setTime},
        {"fmi3SetContinuousStates", ". . . . .", vector<fmi3SetContinuousStates>},
        {"fmi3GetContinuousStateDerivatives", ". . . . .", vector<fmi3GetContinuousStateDerivatives>},
        {"fmi3GetEventIndicators", ". . . . .", vector<fmi3GetEventIndicators>},
        {"fmi3GetContinuousStates", ". . . . .", vector<fmi3GetContinuousStates>},
        {"fmi3GetNominalsOfContinuousStates", ". . . . .", vector<fmi3GetNominalsOfContinuousStates>},
        {"fmi3GetNumberOfEventIndicators", ". . . . .", number<fmi3GetNumberOfEventIndicators>},
        {"fmi3GetNumberOfContinuousStates", ". . . . .", number<fmi3GetNumberOfContinuousStates>},
        {"fmi3ActivateModelPartition", ". . . . .", activateModelPartition},
    },
    "fmi3EnterInitializationMode",
    "fmi3ExitInitializationMode",
    "fmi3Terminate",
    "fmi3Reset",
    "fmi3GetFloat64",
    "fmi3InstantiateCoSimulation",
    {"fmi3DoStep", "fmi3DoStep", "fmi3SetFloat64", "fmi3GetFloat64", "fmi3GetAdjointDerivative", "fmi3GetFMUState",
     "fmi3SetFMUState", "fmi3SerializeFMUState", "fmi3DeserializeFMUState"},
    {"fmi3SetDebugLogging",
     "fmi3SetFloat64",
     "fmi3GetFMUState",
     "fmi3EnterInitializationMode",
     "fmi3GetFloat64",
     "fmi3ExitInitializationMode",
     "fmi3GetFloat64",
     "fmi3DoStep",
     "fmi3GetFloat64",
     "fmi3SetFloat64",
     "fmi3GetNumberOfVariableDependencies",
     "fmi3GetVariableDependencies",
     "fmi3GetDirectionalDerivative",
     "fmi3GetAdjointDerivative",
     "fmi3GetOutputDerivatives",
     "fmi3GetFMUState",
     "fmi3SerializedFMUStateSize",
     "fmi3SerializeFMUState",
     "fmi3DeserializeFMUState",
     "fmi3SetFMUState",
     "fmi3GetInt64",
     "fmi3SetUInt8",
     "fmi3EnterEventMode",
     "fmi3Terminate",
     "fmi3GetFloat64",
     "fmi3Reset"},
    {"only co-simulation is supported", "there are no events and no clocks", "there are no structural parameters"},
    instantiate,
    [](Session& s) { fmi3FreeInstance(s.component); },
    setInputs,
    step,
    [](Session& s, State believed) {
      if (believed != terminated) return fmi3SetFloat64(s.component, nullptr, 0, nullptr, 0) != fmi3OK;
      fmi3ExitInitializationMode(s.component);  // the same calls are allowed: its refusal says the state
      const std::string& said = s.log.back().text;
      return said.find("Terminated") == std::string::npos;
    },
    {
        "fmi3GetFMUState",
        "fmi3SetFMUState",
        "fmi3FreeFMUState",
        "fmi3SerializedFMUStateSize",
        "fmi3SerializeFMUState",
        "fmi3DeserializeFMUState",
        [](Session& s, void** state) -> int { return fmi3GetFMUState(s.component, state); },
        [](Session& s, void* state) -> int { return fmi3SetFMUState(s.component, state); },
        [](Session& s, void** state) -> int { return fmi3FreeFMUState(s.component, state); },
        [](Session& s, void* state, std::size_t* size) -> int {
          return fmi3SerializedFMUStateSize(s.component, state, size);
        },
        [](Session& s, void* state, char* bytes, std::size_t size) -> int {
          return fmi3SerializeFMUState(s.component, state, reinterpret_cast<fmi3Byte*>(bytes), size);
        },
        [](Session& s, const char* bytes, std::size_t size, void** state) -> int {
          return fmi3DeserializeFMUState(s.component, reinterpret_cast<const fmi3Byte*>(bytes), size, state);
        },
    },
};
