// FMI 2.0: one of each call with good arguments, and the table of section 4.2.4.
#include <cstdarg>
#include <cstdio>
#include <cstdlib>

#include "memory.hpp"
#include "session.hpp"

extern "C" {
#include "fmi2Functions.h"
}

namespace {

void keep(fmi2ComponentEnvironment environment, fmi2String, fmi2Status status, fmi2String category, fmi2String format,
          ...) {
  const memory::Pause pause;
  char text[4000];
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  static_cast<Session*>(environment)->log.push_back({status, category, text});
}

void instantiate(Session& s, const char* token, bool logging) {
  const fmi2CallbackFunctions functions{keep, std::calloc, std::free, nullptr, &s};
  s.component =
      fmi2Instantiate("session", fmi2CoSimulation, token, s.packed.folder.c_str(), &functions, fmi2False, logging);
}

// One of each call with good arguments.

int setDebugLogging(Session& s) { return fmi2SetDebugLogging(s.component, fmi2False, 0, nullptr); }
int setupExperiment(Session& s) { return fmi2SetupExperiment(s.component, fmi2False, 0, 0, fmi2True, 100); }
int enterInitializationMode(Session& s) { return fmi2EnterInitializationMode(s.component); }
int exitInitializationMode(Session& s) { return fmi2ExitInitializationMode(s.component); }
int terminate(Session& s) { return fmi2Terminate(s.component); }
int reset(Session& s) { return fmi2Reset(s.component); }

int getReal(Session& s) {
  const int status = fmi2GetReal(s.component, s.packed.readable.data(), s.packed.readable.size(), s.read.data());
  s.give(s.read);
  return status;
}
int getInteger(Session& s) { return fmi2GetInteger(s.component, nullptr, 0, nullptr); }
int getBoolean(Session& s) { return fmi2GetBoolean(s.component, nullptr, 0, nullptr); }
int getString(Session& s) { return fmi2GetString(s.component, nullptr, 0, nullptr); }

int setReal(Session& s) {
  return fmi2SetReal(s.component, s.packed.inputs.data(), s.packed.inputs.size(), s.set.data());
}
int setInteger(Session& s) { return fmi2SetInteger(s.component, nullptr, 0, nullptr); }
int setBoolean(Session& s) { return fmi2SetBoolean(s.component, nullptr, 0, nullptr); }
int setString(Session& s) { return fmi2SetString(s.component, nullptr, 0, nullptr); }

int getDirectionalDerivative(Session& s) {
  const Packed& p = s.packed;
  const int status = fmi2GetDirectionalDerivative(s.component, p.outputs.data(), p.outputs.size(), p.inputs.data(),
                                                  p.inputs.size(), s.change.data(), s.changes.data());
  s.give(s.changes);
  return status;
}
int setInputDerivatives(Session& s) {
  return fmi2SetRealInputDerivatives(s.component, s.packed.inputs.data(), s.packed.inputs.size(), s.orders.data(),
                                     s.slope.data());
}
int getOutputDerivatives(Session& s) {
  const Packed& p = s.packed;
  const int status =
      fmi2GetRealOutputDerivatives(s.component, p.outputs.data(), p.outputs.size(), s.orders.data(), s.changes.data());
  s.give(s.changes);
  return status;
}

int doStep(Session& s) { return fmi2DoStep(s.component, 0, 0.01, fmi2True); }
int cancelStep(Session& s) { return fmi2CancelStep(s.component); }
int getStatus(Session& s) {
  fmi2Status value = fmi2OK;
  return fmi2GetStatus(s.component, fmi2DoStepStatus, &value);
}
template <class T, auto function, fmi2StatusKind kind> int numberStatus(Session& s) {
  T value = -1;
  const int status = function(s.component, kind, &value);
  s.give(&value, sizeof value);
  return status;
}
int getIntegerStatus(Session& s) {
  fmi2Integer value = -1;
  return fmi2GetIntegerStatus(s.component, fmi2DoStepStatus, &value);
}
int getStringStatus(Session& s) {
  fmi2String value = nullptr;
  return fmi2GetStringStatus(s.component, fmi2PendingStatus, &value);
}

// Calls of model exchange: never allowed.

int enterEventMode(Session& s) { return fmi2EnterEventMode(s.component); }
int newDiscreteStates(Session& s) {
  fmi2EventInfo info{};
  return fmi2NewDiscreteStates(s.component, &info);
}
int enterContinuousTimeMode(Session& s) { return fmi2EnterContinuousTimeMode(s.component); }
int completedIntegratorStep(Session& s) {
  fmi2Boolean enter = fmi2False, over = fmi2False;
  return fmi2CompletedIntegratorStep(s.component, fmi2True, &enter, &over);
}
int setTime(Session& s) { return fmi2SetTime(s.component, 1); }
int setContinuousStates(Session& s) { return fmi2SetContinuousStates(s.component, nullptr, 0); }
int getDerivatives(Session& s) { return fmi2GetDerivatives(s.component, nullptr, 0); }
int getEventIndicators(Session& s) { return fmi2GetEventIndicators(s.component, nullptr, 0); }
int getContinuousStates(Session& s) { return fmi2GetContinuousStates(s.component, nullptr, 0); }
int getNominals(Session& s) { return fmi2GetNominalsOfContinuousStates(s.component, nullptr, 0); }

}  // namespace

//                                        instantiated
//                                        | initializationMode
//                                        | | stepComplete
//                                        | | | terminated
//                                        | | | | error
const Standard fmi2{
    {"instantiated", "initializationMode", "stepComplete", "terminated", "error"},
    {
        {"fmi2SetDebugLogging", "x x x x x", setDebugLogging},
        {"fmi2SetupExperiment", "x . . . .", setupExperiment},
        {"fmi2EnterInitializationMode", "x . . . .", enterInitializationMode},
        {"fmi2ExitInitializationMode", ". x . . .", exitInitializationMode},
        {"fmi2Terminate", ". . x . .", terminate},
        {"fmi2Reset", "x x x x x", reset},
        {"fmi2GetReal", ". x x x x", getReal},
        {"fmi2GetInteger", ". x x x x", getInteger},
        {"fmi2GetBoolean", ". x x x x", getBoolean},
        {"fmi2GetString", ". x x x x", getString},
        {"fmi2SetReal", "x x x . .", setReal},
        {"fmi2SetInteger", "x x x . .", setInteger},
        {"fmi2SetBoolean", "x x x . .", setBoolean},
        {"fmi2SetString", "x x x . .", setString},
        {"fmi2GetFMUstate", "x x x x x", getState},
        {"fmi2SetFMUstate", "x x x x x", setState},
        {"fmi2FreeFMUstate", "x x x x x", freeState},
        {"fmi2SerializedFMUstateSize", "x x x x x", serializedSize},
        {"fmi2SerializeFMUstate", "x x x x x", serialize},
        {"fmi2DeSerializeFMUstate", "x x x x x", deserialize},
        {"fmi2GetDirectionalDerivative", ". x x x x", getDirectionalDerivative},
        {"fmi2SetRealInputDerivatives", "x x x . .", setInputDerivatives},
        {"fmi2GetRealOutputDerivatives", ". . x x x", getOutputDerivatives},
        {"fmi2DoStep", ". . x . .", doStep},
        {"fmi2CancelStep", ". . . . .", cancelStep},
        {"fmi2GetStatus", ". . x x .", getStatus},
        {"fmi2GetRealStatus", ". . x x .", numberStatus<fmi2Real, fmi2GetRealStatus, fmi2LastSuccessfulTime>},
        {"fmi2GetIntegerStatus", ". . x x .", getIntegerStatus},
        {"fmi2GetBooleanStatus", ". . x x .", numberStatus<fmi2Boolean, fmi2GetBooleanStatus, fmi2Terminated>},
        {"fmi2GetStringStatus", ". . x x .", getStringStatus},
        {"fmi2EnterEventMode", ". . . . .", enterEventMode},
        {"fmi2NewDiscreteStates", ". . . . .", newDiscreteStates},
        {"fmi2EnterContinuousTimeMode", ". . . . .", enterContinuousTimeMode},
        {"fmi2CompletedIntegratorStep", ". . . . .", completedIntegratorStep},
        {"fmi2SetTime", ". . . . .", setTime},
        {"fmi2SetContinuousStates", ". . . . .", setContinuousStates},
        {"fmi2GetDerivatives", ". . . . .", getDerivatives},
        {"fmi2GetEventIndicators", ". . . . .", getEventIndicators},
        {"fmi2GetContinuousStates", ". . . . .", getContinuousStates},
        {"fmi2GetNominalsOfContinuousStates", ". . . . .", getNominals},
    },
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2Reset",
    "fmi2GetReal",
    "fmi2Instantiate",
    {"fmi2DoStep", "fmi2DoStep", "fmi2SetReal", "fmi2GetReal", "fmi2SetRealInputDerivatives", "fmi2GetFMUstate",
     "fmi2SetFMUstate", "fmi2SerializeFMUstate", "fmi2DeSerializeFMUstate"},
    {"fmi2SetDebugLogging",
     "fmi2SetupExperiment",
     "fmi2SetReal",
     "fmi2GetFMUstate",
     "fmi2EnterInitializationMode",
     "fmi2GetReal",
     "fmi2ExitInitializationMode",
     "fmi2GetReal",
     "fmi2SetRealInputDerivatives",
     "fmi2DoStep",
     "fmi2GetReal",
     "fmi2SetReal",
     "fmi2GetDirectionalDerivative",
     "fmi2GetRealOutputDerivatives",
     "fmi2GetFMUstate",
     "fmi2SerializedFMUstateSize",
     "fmi2SerializeFMUstate",
     "fmi2DeSerializeFMUstate",
     "fmi2SetFMUstate",
     "fmi2GetRealStatus",
     "fmi2GetStringStatus",
     "fmi2GetInteger",
     "fmi2Terminate",
     "fmi2GetReal",
     "fmi2Reset"},
    {"only co-simulation is supported"},
    instantiate,
    [](Session& s) { fmi2FreeInstance(s.component); },
    [](Session& s, const Values& values) -> int {
      return fmi2SetReal(s.component, s.packed.inputs.data(), values.size(), values.data());
    },
    [](Session& s, double time, double size) -> int { return fmi2DoStep(s.component, time, size, fmi2False); },
    [](Session& s, State believed) {
      fmi2Boolean over = fmi2False;
      return (believed == terminated ? fmi2GetBooleanStatus(s.component, fmi2Terminated, &over)
                                     : fmi2SetReal(s.component, nullptr, 0, nullptr)) != fmi2OK;
    },
    {
        "fmi2GetFMUstate",
        "fmi2SetFMUstate",
        "fmi2FreeFMUstate",
        "fmi2SerializedFMUstateSize",
        "fmi2SerializeFMUstate",
        "fmi2DeSerializeFMUstate",
        [](Session& s, void** state) -> int { return fmi2GetFMUstate(s.component, state); },
        [](Session& s, void* state) -> int { return fmi2SetFMUstate(s.component, state); },
        [](Session& s, void** state) -> int { return fmi2FreeFMUstate(s.component, state); },
        [](Session& s, void* state, std::size_t* size) -> int {
          return fmi2SerializedFMUstateSize(s.component, state, size);
        },
        [](Session& s, void* state, char* bytes, std::size_t size) -> int {
          return fmi2SerializeFMUstate(s.component, state, bytes, size);
        },
        [](Session& s, const char* bytes, std::size_t size, void** state) -> int {
          return fmi2DeSerializeFMUstate(s.component, bytes, size, state);
        },
    },
};
