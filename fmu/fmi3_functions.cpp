// The functions of FMI 3.0 co-simulation. Each goes through `guard`: no exception leaves the library. What the standard
// has beyond co-simulation without events and clocks is in fmi3_others.cpp.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <type_traits>

#include "array_access.hpp"
#include "fmi3_calls.hpp"
#include "fmi3_instance.hpp"
#include "resource_folder.hpp"

using namespace tiefmu;
using fmi3::guard;
namespace call = fmi3::call;

static_assert(std::is_same_v<fmi3ValueReference, std::uint32_t> && std::is_same_v<fmi3Float64, double> &&
              std::is_same_v<fmi3Int64, std::int64_t> && std::is_same_v<fmi3Int32, int> &&
              std::is_same_v<fmi3FMUState, void*> && std::is_same_v<fmi3String, const char*> &&
              sizeof(fmi3Byte) == 1);  // what the instance takes and gives

namespace {

class CallbackLog final : public Log {
 public:
  CallbackLog(fmi3LogMessageCallback callback, fmi3InstanceEnvironment environment, bool loggingOn)
      : callback_(callback), environment_(environment) {
    on = loggingOn;
  }

 private:
  void send(Severity severity, const char* category, const char* message) const noexcept override {
    if (!callback_) return;
    callback_(environment_,
              severity == Severity::error     ? fmi3Error
              : severity == Severity::warning ? fmi3Warning
                                              : fmi3OK,
              category, message);
  }

  fmi3LogMessageCallback callback_;
  fmi3InstanceEnvironment environment_;
};

// Where the importer wants to be asked, a step is done substep by substep: after each but the last it may set inputs,
// get outputs, and have the step end earlier. True if it did.
bool step(Fmi3Instance& own, double point, double size) {
  Instance& i = own.instance;
  i.checkStep(point, size);  // a step that is refused has not begun
  double end = point + size, left = size, at = point;
  bool returnsEarly = false, last = false;
  for (;;) {
    try {
      const double count = own.intermediateUpdate ? i.substepsOf(left) : 1;
      last = count == 1;
      i.doStep(at, left / count);
    } catch (const Refused& e) {
      if (at == point) throw;
      throw std::runtime_error(e.what());
    }
    if (last) return returnsEarly;
    fmi3Boolean early = fmi3False;
    fmi3Float64 until = i.time();
    i.state = State::inStep;
    own.intermediateUpdate(own.environment, i.time(), fmi3True, fmi3True, fmi3True, own.earlyReturn, &early, &until);
    if (i.state != State::inStep) throw std::runtime_error("a call in Intermediate Update Mode failed");
    i.state = State::stepComplete;
    at = i.time();
    if (early && own.earlyReturn) {
      returnsEarly = true;
      end = std::min(end, until);
    }
    left = end - at;
    if (!(left > 0)) return true;
  }
}

}  // namespace

extern "C" {

const char* fmi3GetVersion() { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                         fmi3String resourcePath, fmi3Boolean /*visible*/, fmi3Boolean loggingOn,
                                         fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference /*requiredIntermediateVariables*/[],
                                         size_t /*nRequiredIntermediateVariables*/, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate) {
  const auto fail = [&](const char* message) -> fmi3Instance {
    char line[2000];
    std::snprintf(line, sizeof line, "fmi3InstantiateCoSimulation: %s", message);
    if (logMessage) logMessage(environment, fmi3Error, "logStatusError", line);
    return nullptr;
  };
  try {
    if (!instanceName) return fail("the instance name is a null pointer");
    if (isBlank(instanceName)) return fail("the instance name is empty or blank");
    if (!instantiationToken) return fail("the instantiation token is a null pointer");
    if (!resourcePath) return fail("the resource path is a null pointer");
    if (eventModeUsed) return fail("there is no event mode");
    return new Fmi3Instance(std::make_unique<CallbackLog>(logMessage, environment, loggingOn),
                            loadResource(resourcePath, instantiationToken), environment, intermediateUpdate,
                            earlyReturnAllowed);
  } catch (const std::exception& e) {
    return fail(e.what());
  } catch (...) {
    return fail("unknown exception");
  }
}

void fmi3FreeInstance(fmi3Instance c) { delete static_cast<Fmi3Instance*>(c); }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
  return guard(c, call::setDebugLogging,
               [&](Fmi3Instance& own) { own.instance.log->choose(loggingOn, nCategories, categories); });
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean /*toleranceDefined*/, fmi3Float64 /*tolerance*/,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
  return guard(c, call::enterInitializationMode, [&](Fmi3Instance& own) {
    own.instance.setupExperiment(startTime, stopTimeDefined, stopTime);
    own.instance.enterInitializationMode();
  });
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  return guard(c, call::exitInitializationMode, [](Fmi3Instance& own) { own.instance.exitInitializationMode(); });
}

fmi3Status fmi3Terminate(fmi3Instance c) {
  return guard(c, call::terminate, [](Fmi3Instance& own) { own.instance.state = State::terminated; });
}

fmi3Status fmi3Reset(fmi3Instance c) {
  return guard(c, call::reset, [](Fmi3Instance& own) { own.instance.reset(); });
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[], size_t size) {
  return guard(c, call::getFloat64, [&](Fmi3Instance& own) { own.arrays.get(vr, n, values, size); });
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                          size_t size) {
  return guard(c, call::setFloat64, [&](Fmi3Instance& own) { own.arrays.set(vr, n, values, size); });
}

fmi3Status fmi3GetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int64 values[], size_t size) {
  return guard(c, call::getInt64, [&](Fmi3Instance& own) { own.arrays.getIds(vr, n, values, size); });
}

fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3String values[], size_t size) {
  return guard(c, call::getString, [&](Fmi3Instance& own) { own.arrays.getLabels(vr, n, values, size); });
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t* count) {
  return guard(c, call::getNumberOfDependencies, [&](Fmi3Instance& own) {
    if (!count) throw Refused("the place for the number is a null pointer");
    *count = own.arrays.dependenciesOf(vr).size();
  });
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent, size_t elementsOfDependent[],
                                       fmi3ValueReference independents[], size_t elementsOfIndependents[],
                                       fmi3DependencyKind kinds[], size_t count) {
  return guard(c, call::getDependencies, [&](Fmi3Instance& own) {
    const auto entries = own.arrays.dependenciesOf(dependent);
    if (count != entries.size())
      throw Refused("the variable has " + std::to_string(entries.size()) + " dependencies, not " +
                    std::to_string(count));
    if (count > 0 && (!elementsOfDependent || !independents || !elementsOfIndependents || !kinds))
      throw Refused("an array of indices, references or kinds is a null pointer");
    for (std::size_t k = 0; k < count; ++k) {
      elementsOfDependent[k] = entries[k].dependent;
      independents[k] = entries[k].array;
      elementsOfIndependents[k] = entries[k].independent;
      kinds[k] = entries[k].kind == Dependence::constant ? fmi3Constant
                 : entries[k].kind == Dependence::fixed  ? fmi3Fixed
                                                         : fmi3Dependent;
    }
  });
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState* state) {
  return guard(c, call::getFMUState, [&](Fmi3Instance& own) { own.instance.getState(state); });
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  return guard(c, call::setFMUState, [&](Fmi3Instance& own) { own.instance.setState(state); });
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState* state) {
  return guard(c, call::freeFMUState, [&](Fmi3Instance& own) { own.instance.freeState(state); });
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t* size) {
  return guard(c, call::serializedFMUStateSize, [&](Fmi3Instance& own) {
    if (!size) throw Refused("the place for the size is a null pointer");
    *size = own.instance.serializedStateSize(state);
  });
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  return guard(c, call::serializeFMUState,
               [&](Fmi3Instance& own) { own.instance.serializeState(state, reinterpret_cast<char*>(bytes), size); });
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState* state) {
  return guard(c, call::deserializeFMUState, [&](Fmi3Instance& own) {
    own.instance.deserializeState(reinterpret_cast<const char*>(bytes), size, state);
  });
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
  return guard(c, call::getDirectionalDerivative, [&](Fmi3Instance& own) {
    own.arrays.derivative(Way::forward, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity);
  });
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
  return guard(c, call::getAdjointDerivative, [&](Fmi3Instance& own) {
    own.arrays.derivative(Way::transposed, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity,
                          nSensitivity);
  });
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t size) {
  return guard(c, call::getOutputDerivatives,
               [&](Fmi3Instance& own) { own.arrays.outputDerivatives(vr, n, orders, values, size); });
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 point, fmi3Float64 size,
                      fmi3Boolean /*noSetFMUStatePriorToCurrentPoint*/, fmi3Boolean* eventHandlingNeeded,
                      fmi3Boolean* terminateSimulation, fmi3Boolean* earlyReturn, fmi3Float64* lastSuccessfulTime) {
  return guard(c, call::doStep, [&](Fmi3Instance& own) {
    if (!eventHandlingNeeded || !terminateSimulation || !earlyReturn || !lastSuccessfulTime)
      throw Refused("the place for a result is a null pointer");
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = own.instance.time();
    *earlyReturn = step(own, point, size);
    *lastSuccessfulTime = own.instance.time();
  });
}

}  // extern "C"
