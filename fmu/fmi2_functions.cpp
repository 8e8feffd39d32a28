// The functions of FMI 2.0 co-simulation. Each goes through `guard`: no exception leaves the library.
#include <cstdio>
#include <cstring>
#include <type_traits>

#include "fmi2_calls.hpp"
#include "instance.hpp"
#include "resource_folder.hpp"

extern "C" {
#include "fmi2Functions.h"
}

using namespace tiefmu;
namespace call = fmi2::call;

static_assert(std::is_same_v<fmi2ValueReference, std::uint32_t> && std::is_same_v<fmi2Real, double> &&
              std::is_same_v<fmi2Integer, int> && std::is_same_v<fmi2Byte, char> &&
              std::is_same_v<fmi2FMUstate, void*> &&
              std::is_same_v<fmi2String, const char*>);  // what the instance takes and gives

namespace {

// Hands a finished message to the caller. The callback takes a printf format, and not every importer reads the
// arguments after it: the message is the format, its % doubled. No allocation: memory may be what is lacking.
void deliver(const fmi2CallbackLogger callback, fmi2ComponentEnvironment environment, const char* instanceName,
             fmi2Status status, const char* category, const char* message) noexcept {
  if (!callback) return;
  char format[4096];
  if (std::strchr(message, '%')) {
    std::size_t n = 0;
    for (; *message && n + 2 < sizeof format; ++message) {
      if (*message == '%') format[n++] = '%';
      format[n++] = *message;
    }
    format[n] = 0;
    message = format;
  }
  callback(environment, instanceName, status, category, message);
}

// Copied from the caller's callbacks; the environment goes back to it with every message.
class CallbackLog final : public Log {
 public:
  CallbackLog(const fmi2CallbackFunctions& functions, const char* instanceName, bool loggingOn)
      : callback_(functions.logger), environment_(functions.componentEnvironment), instanceName_(instanceName) {
    on = loggingOn;
  }

 private:
  void send(Severity severity, const char* category, const char* message) const noexcept override {
    const fmi2Status status = severity == Severity::error     ? fmi2Error
                              : severity == Severity::warning ? fmi2Warning
                                                              : fmi2OK;
    deliver(callback_, environment_, instanceName_.c_str(), status, category, message);
  }

  fmi2CallbackLogger callback_;
  fmi2ComponentEnvironment environment_;
  std::string instanceName_;
};

template <class Body> fmi2Status guard(fmi2Component component, const Call& call, Body body) noexcept {
  return succeeds(static_cast<Instance*>(component), call, fmi2::stateName, body) ? fmi2OK : fmi2Error;
}

// For the variable types that no scene has: only an empty call is right.
fmi2Status noVariables(fmi2Component c, const Call& call, size_t count) {
  return guard(c, call, [&](Instance&) {
    if (count > 0) throw Refused("all variables are of type Real");
  });
}

}  // namespace

extern "C" {

const char* fmi2GetTypesPlatform() { return fmi2TypesPlatform; }

const char* fmi2GetVersion() { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions* functions,
                              fmi2Boolean /*visible*/, fmi2Boolean loggingOn) {
  const auto fail = [&](const char* message) -> fmi2Component {
    char line[2000];
    std::snprintf(line, sizeof line, "fmi2Instantiate: %s", message);
    if (functions)
      deliver(functions->logger, functions->componentEnvironment, instanceName ? instanceName : "", fmi2Error,
              "logStatusError", line);
    return nullptr;
  };
  try {
    if (!functions) return fail("the callback functions are a null pointer");
    if (!instanceName) return fail("the instance name is a null pointer");
    if (isBlank(instanceName)) return fail("the instance name is empty or blank");
    if (!fmuGUID) return fail("the GUID is a null pointer");
    if (!fmuResourceLocation) return fail("the resource location is a null pointer");
    if (fmuType != fmi2CoSimulation) return fail("only co-simulation is supported");
    return new Instance(std::make_unique<CallbackLog>(*functions, instanceName, loggingOn),
                        loadResource(fmuResourceLocation, fmuGUID));
  } catch (const std::exception& e) {
    return fail(e.what());
  } catch (...) {
    return fail("unknown exception");
  }
}

void fmi2FreeInstance(fmi2Component c) { delete static_cast<Instance*>(c); }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
  return guard(c, call::setDebugLogging, [&](Instance& i) { i.log->choose(loggingOn, nCategories, categories); });
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean /*toleranceDefined*/, fmi2Real /*tolerance*/,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
  return guard(c, call::setupExperiment, [&](Instance& i) { i.setupExperiment(startTime, stopTimeDefined, stopTime); });
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  return guard(c, call::enterInitializationMode, [](Instance& i) { i.enterInitializationMode(); });
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  return guard(c, call::exitInitializationMode, [](Instance& i) { i.exitInitializationMode(); });
}

fmi2Status fmi2Terminate(fmi2Component c) {
  return guard(c, call::terminate, [](Instance& i) { i.state = State::terminated; });
}

fmi2Status fmi2Reset(fmi2Component c) {
  return guard(c, call::reset, [](Instance& i) { i.reset(); });
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
  return guard(c, call::getReal, [&](Instance& i) { i.get(vr, nvr, value); });
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference*, size_t nvr, fmi2Integer*) {
  return noVariables(c, call::getInteger, nvr);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference*, size_t nvr, fmi2Boolean*) {
  return noVariables(c, call::getBoolean, nvr);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference*, size_t nvr, fmi2String*) {
  return noVariables(c, call::getString, nvr);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
  return guard(c, call::setReal, [&](Instance& i) { i.set(vr, nvr, value); });
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference*, size_t nvr, const fmi2Integer*) {
  return noVariables(c, call::setInteger, nvr);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference*, size_t nvr, const fmi2Boolean*) {
  return noVariables(c, call::setBoolean, nvr);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference*, size_t nvr, const fmi2String*) {
  return noVariables(c, call::setString, nvr);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* state) {
  return guard(c, call::getFMUstate, [&](Instance& i) { i.getState(state); });
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  return guard(c, call::setFMUstate, [&](Instance& i) { i.setState(state); });
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate* state) {
  return guard(c, call::freeFMUstate, [&](Instance& i) { i.freeState(state); });
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t* size) {
  return guard(c, call::serializedFMUstateSize, [&](Instance& i) {
    if (!size) throw Refused("the place for the size is a null pointer");
    *size = i.serializedStateSize(state);
  });
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  return guard(c, call::serializeFMUstate, [&](Instance& i) { i.serializeState(state, bytes, size); });
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate* state) {
  return guard(c, call::deSerializeFMUstate, [&](Instance& i) { i.deserializeState(bytes, size, state); });
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t unknowns,
                                        const fmi2ValueReference known[], size_t knowns, const fmi2Real seed[],
                                        fmi2Real change[]) {
  return guard(c, call::getDirectionalDerivative,
               [&](Instance& i) { i.directionalDerivative(unknown, unknowns, known, knowns, seed, change); });
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  return guard(c, call::setRealInputDerivatives, [&](Instance& i) { i.setInputDerivatives(vr, nvr, order, value); });
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
  return guard(c, call::getRealOutputDerivatives, [&](Instance& i) { i.outputDerivatives(vr, nvr, order, value); });
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean /*noSetFMUStatePriorToCurrentPoint*/) {
  return guard(c, call::doStep, [&](Instance& i) { i.doStep(currentCommunicationPoint, communicationStepSize); });
}

fmi2Status fmi2CancelStep(fmi2Component c) {
  return guard(c, call::cancelStep, [](Instance&) {});  // never allowed: no step is ever in progress
}

// Of the kinds of status only these are known; the standard's answer to the others is fmi2Discard.

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind, fmi2Status*) {
  const fmi2Status status = guard(c, call::getStatus, [](Instance&) {});
  return status == fmi2OK ? fmi2Discard : status;  // only of interest after fmi2Pending
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real* value) {
  const fmi2Status status = guard(c, call::getRealStatus, [&](Instance& i) {
    if (!value) throw Refused("the place for the value is a null pointer");
    if (kind == fmi2LastSuccessfulTime) *value = i.time();
  });
  return status == fmi2OK && kind != fmi2LastSuccessfulTime ? fmi2Discard : status;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind, fmi2Integer*) {
  const fmi2Status status = guard(c, call::getIntegerStatus, [](Instance&) {});
  return status == fmi2OK ? fmi2Discard : status;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean* value) {
  const fmi2Status status = guard(c, call::getBooleanStatus, [&](Instance&) {
    if (!value) throw Refused("the place for the value is a null pointer");
    if (kind == fmi2Terminated) *value = fmi2False;
  });
  return status == fmi2OK && kind != fmi2Terminated ? fmi2Discard : status;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind, fmi2String*) {
  const fmi2Status status = guard(c, call::getStringStatus, [](Instance&) {});
  return status == fmi2OK ? fmi2Discard : status;
}

}  // extern "C"
