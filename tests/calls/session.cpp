#include "session.hpp"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <numeric>

#include "../../fmu/resource.hpp"
#include "../../modelDescription/variables.hpp"
#include "memory.hpp"

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

// Numbers from -0.25 to 0.25, others at each step.
Values wave(std::size_t count, int step) {
  Values values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = 0.05 * static_cast<double>((7 * i + 3 * step) % 11) - 0.25;
  return values;
}

// Inputs near their start values.
Values inputs(const Packed& packed, int step) {
  Values values = wave(packed.inputs.size(), step);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] += packed.start[packed.inputs[i]];
  return values;
}

// One of each call with good arguments.

fmi2Status setDebugLogging(Session& s) { return fmi2SetDebugLogging(s.component, fmi2False, 0, nullptr); }
fmi2Status setupExperiment(Session& s) { return fmi2SetupExperiment(s.component, fmi2False, 0, 0, fmi2True, 100); }
fmi2Status enterInitializationMode(Session& s) { return fmi2EnterInitializationMode(s.component); }
fmi2Status exitInitializationMode(Session& s) { return fmi2ExitInitializationMode(s.component); }
fmi2Status terminate(Session& s) { return fmi2Terminate(s.component); }
fmi2Status reset(Session& s) { return fmi2Reset(s.component); }

fmi2Status getReal(Session& s) {
  const fmi2Status status = fmi2GetReal(s.component, s.all.data(), s.all.size(), s.read.data());
  s.give(s.read.data(), s.read.size() * sizeof(double));
  return status;
}
fmi2Status getInteger(Session& s) { return fmi2GetInteger(s.component, nullptr, 0, nullptr); }
fmi2Status getBoolean(Session& s) { return fmi2GetBoolean(s.component, nullptr, 0, nullptr); }
fmi2Status getString(Session& s) { return fmi2GetString(s.component, nullptr, 0, nullptr); }

fmi2Status setReal(Session& s) {
  return fmi2SetReal(s.component, s.packed.inputs.data(), s.packed.inputs.size(), s.set.data());
}
fmi2Status setInteger(Session& s) { return fmi2SetInteger(s.component, nullptr, 0, nullptr); }
fmi2Status setBoolean(Session& s) { return fmi2SetBoolean(s.component, nullptr, 0, nullptr); }
fmi2Status setString(Session& s) { return fmi2SetString(s.component, nullptr, 0, nullptr); }

fmi2Status getState(Session& s) { return fmi2GetFMUstate(s.component, &s.saved[1]); }
fmi2Status setState(Session& s) { return fmi2SetFMUstate(s.component, s.saved[s.saved[1] ? 1 : 0]); }
fmi2Status freeState(Session& s) { return fmi2FreeFMUstate(s.component, &s.saved[0]); }
fmi2Status serializedSize(Session& s) {
  std::size_t size = 0;
  const fmi2Status status = fmi2SerializedFMUstateSize(s.component, s.saved[0], &size);
  s.give(&size, sizeof size);
  return status;
}
fmi2Status serialize(Session& s) {
  const fmi2Status status = fmi2SerializeFMUstate(s.component, s.saved[0], s.buffer.data(), s.buffer.size());
  s.give(s.buffer.data(), s.buffer.size());
  return status;
}
fmi2Status deSerialize(Session& s) {
  return fmi2DeSerializeFMUstate(s.component, s.bytes[0].data(), s.bytes[0].size(), &s.saved[2]);
}

fmi2Status getDirectionalDerivative(Session& s) {
  const Packed& p = s.packed;
  const fmi2Status status =
      fmi2GetDirectionalDerivative(s.component, p.outputs.data(), p.outputs.size(), p.inputs.data(), p.inputs.size(),
                                   s.change.data(), s.changes.data());
  s.give(s.changes.data(), s.changes.size() * sizeof(double));
  return status;
}
fmi2Status setInputDerivatives(Session& s) {
  return fmi2SetRealInputDerivatives(s.component, s.packed.inputs.data(), s.packed.inputs.size(), s.orders.data(),
                                     s.slope.data());
}
fmi2Status getOutputDerivatives(Session& s) {
  const Packed& p = s.packed;
  const fmi2Status status =
      fmi2GetRealOutputDerivatives(s.component, p.outputs.data(), p.outputs.size(), s.orders.data(), s.changes.data());
  s.give(s.changes.data(), s.changes.size() * sizeof(double));
  return status;
}

fmi2Status doStep(Session& s) { return fmi2DoStep(s.component, 0, 0.01, fmi2True); }
fmi2Status cancelStep(Session& s) { return fmi2CancelStep(s.component); }
fmi2Status getStatus(Session& s) {
  fmi2Status value = fmi2OK;
  return fmi2GetStatus(s.component, fmi2DoStepStatus, &value);
}
fmi2Status getRealStatus(Session& s) {
  fmi2Real value = -1;
  const fmi2Status status = fmi2GetRealStatus(s.component, fmi2LastSuccessfulTime, &value);
  s.give(&value, sizeof value);
  return status;
}
fmi2Status getIntegerStatus(Session& s) {
  fmi2Integer value = -1;
  return fmi2GetIntegerStatus(s.component, fmi2DoStepStatus, &value);
}
fmi2Status getBooleanStatus(Session& s) {
  fmi2Boolean value = -1;
  const fmi2Status status = fmi2GetBooleanStatus(s.component, fmi2Terminated, &value);
  s.give(&value, sizeof value);
  return status;
}
fmi2Status getStringStatus(Session& s) {
  fmi2String value = nullptr;
  return fmi2GetStringStatus(s.component, fmi2PendingStatus, &value);
}

// Calls of model exchange: never allowed.

fmi2Status enterEventMode(Session& s) { return fmi2EnterEventMode(s.component); }
fmi2Status newDiscreteStates(Session& s) {
  fmi2EventInfo info{};
  return fmi2NewDiscreteStates(s.component, &info);
}
fmi2Status enterContinuousTimeMode(Session& s) { return fmi2EnterContinuousTimeMode(s.component); }
fmi2Status completedIntegratorStep(Session& s) {
  fmi2Boolean enter = fmi2False, over = fmi2False;
  return fmi2CompletedIntegratorStep(s.component, fmi2True, &enter, &over);
}
fmi2Status setTime(Session& s) { return fmi2SetTime(s.component, 1); }
fmi2Status setContinuousStates(Session& s) { return fmi2SetContinuousStates(s.component, nullptr, 0); }
fmi2Status getDerivatives(Session& s) { return fmi2GetDerivatives(s.component, nullptr, 0); }
fmi2Status getEventIndicators(Session& s) { return fmi2GetEventIndicators(s.component, nullptr, 0); }
fmi2Status getContinuousStates(Session& s) { return fmi2GetContinuousStates(s.component, nullptr, 0); }
fmi2Status getNominals(Session& s) { return fmi2GetNominalsOfContinuousStates(s.component, nullptr, 0); }

}  // namespace

void fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::_Exit(1);
}

void require(bool truth, const std::string& what) {
  if (!truth) fail(what);
}

Packed::Packed(std::string where) : folder(std::move(where)) {
  std::ifstream stream(folder + "/scene.bin", std::ios::binary);
  const std::string data{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  const tiefmu::Resource resource = tiefmu::readResource(data);
  guid = resource.guid;
  const tiefmu::Simulation simulation(std::make_shared<const tiefmu::Model>(resource.model));
  for (const tiefmu::Block& b : tiefmu::variables(resource.model, simulation.layout())) {
    References& list = b.causality == tiefmu::Causality::input       ? inputs
                       : b.causality == tiefmu::Causality::output    ? outputs
                       : b.causality == tiefmu::Causality::parameter ? parameters
                                                                     : calculated;
    for (std::uint32_t i = 0; i < b.count(); ++i) {
      list.push_back(b.reference + i);
      start.push_back(simulation.data()[b.place + i]);
    }
  }
}

Session::Session(const Packed& p, bool logging) : packed(p) {
  const std::size_t knowns = p.inputs.size(), unknowns = p.outputs.size();
  all.resize(p.start.size());
  std::iota(all.begin(), all.end(), 0);
  read.resize(all.size());
  set = inputs(p, 1);
  change = wave(knowns, 2);
  slope = wave(knowns, 3);
  changes.resize(unknowns);
  orders.assign(std::max(knowns, unknowns), 1);
  instantiate(logging);
  require(component, packed.folder + ": not instantiated: " + (log.empty() ? "" : log.back().text));
}

Session::~Session() { free(); }

void Session::instantiate(bool logging) {
  const fmi2CallbackFunctions functions{keep, std::calloc, std::free, nullptr, this};
  component = fmi2Instantiate("session", fmi2CoSimulation, packed.guid.c_str(), packed.folder.c_str(), &functions,
                              fmi2False, logging);
}

void Session::free() {
  fmi2FreeInstance(component);
  component = nullptr;
}

void Session::give(const void* data, std::size_t size) {
  const memory::Pause pause;
  result.assign(static_cast<const char*>(data), size);
}

const char* stateName(State state) {
  constexpr const char* names[] = {"instantiated", "initializationMode", "stepComplete", "terminated", "error"};
  return names[state];
}

//                                        instantiated
//                                        | initializationMode
//                                        | | stepComplete
//                                        | | | terminated
//                                        | | | | error
const std::vector<Row> standard{
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
    {"fmi2DeSerializeFMUstate", "x x x x x", deSerialize},
    {"fmi2GetDirectionalDerivative", ". x x x x", getDirectionalDerivative},
    {"fmi2SetRealInputDerivatives", "x x x . .", setInputDerivatives},
    {"fmi2GetRealOutputDerivatives", ". . x x x", getOutputDerivatives},
    {"fmi2DoStep", ". . x . .", doStep},
    {"fmi2CancelStep", ". . . . .", cancelStep},
    {"fmi2GetStatus", ". . x x .", getStatus},
    {"fmi2GetRealStatus", ". . x x .", getRealStatus},
    {"fmi2GetIntegerStatus", ". . x x .", getIntegerStatus},
    {"fmi2GetBooleanStatus", ". . x x .", getBooleanStatus},
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
};

const Row& row(const std::string& name) {
  for (const Row& r : standard)
    if (r.name == name) return r;
  fail("no row for " + name);
}

void bring(Session& session, State state) {
  const auto call = [&](fmi2Status status) {
    require(status == fmi2OK, std::string("on the way to state ") + stateName(state) + ": " +
                                  (session.log.empty() ? "" : session.log.back().text));
  };
  if (state != instantiated) call(fmi2EnterInitializationMode(session.component));
  if (state == stepComplete || state == terminated) call(fmi2ExitInitializationMode(session.component));
  if (state == terminated) call(fmi2Terminate(session.component));
  if (state == error) {
    memory::failAfter(0, memory::Throws::badAlloc);
    const fmi2Status status = fmi2GetFMUstate(session.component, &session.saved[1]);
    memory::succeedAgain();
    require(status == fmi2Error, "no memory, but no error");
    session.log.clear();
  }
  call(fmi2GetFMUstate(session.component, &session.saved[0]));
  std::size_t size = 0;
  if (fmi2SerializedFMUstateSize(session.component, session.saved[0], &size) == fmi2OK) {
    session.bytes[0].resize(size);
    call(fmi2SerializeFMUstate(session.component, session.saved[0], session.bytes[0].data(), size));
    session.buffer.resize(size);
  }
  session.log.clear();
}

std::string future(Session& session, State state) {
  std::string bytes;
  const auto must = [&](fmi2Status status, const char* what) {
    require(status == fmi2OK, std::string(what) + ": " + (session.log.empty() ? "" : session.log.back().text));
  };
  const auto read = [&] {
    must(row("fmi2GetReal").call(session), "reading");
    bytes += session.result;
  };
  const auto run = [&](double time) {
    for (int step = 0; step < 3; ++step) {
      const Values set = inputs(session.packed, step);
      must(fmi2SetReal(session.component, session.packed.inputs.data(), set.size(), set.data()), "setting");
      must(fmi2DoStep(session.component, time, 0.05, fmi2False), "stepping");
      time += 0.05;
      read();
    }
  };
  if (state == instantiated) must(fmi2EnterInitializationMode(session.component), "entering");
  read();
  if (state == instantiated || state == initializationMode)
    must(fmi2ExitInitializationMode(session.component), "exiting");
  if (state == instantiated || state == initializationMode || state == stepComplete) run(0);
  must(fmi2Reset(session.component), "resetting");
  must(fmi2EnterInitializationMode(session.component), "entering");
  must(fmi2ExitInitializationMode(session.component), "exiting");
  run(0);
  return bytes;
}
