#include "memory.hpp"
#include "tests.hpp"

namespace {

// A life with states and messages that nobody frees, errors, and failed instantiations.
void live(const Packed& packed) {
  Session session(packed, true);
  bring(session, stepComplete);
  for (const char* name : {"fmi2SetReal", "fmi2DoStep", "fmi2GetReal", "fmi2GetFMUstate", "fmi2DeSerializeFMUstate",
                           "fmi2GetDirectionalDerivative", "fmi2SetRealInputDerivatives",
                           "fmi2GetRealOutputDerivatives", "fmi2SetFMUstate", "fmi2EnterEventMode", "fmi2GetString"})
    row(name).call(session);
  const fmi2ValueReference unknown = ~0u;
  require(fmi2SetReal(session.component, &unknown, 1, nullptr) == fmi2Error, "a null array was taken");
  session.saved[2] = nullptr;
  memory::failAfter(0, memory::Throws::badAlloc);
  const fmi2Status status = fmi2GetFMUstate(session.component, &session.saved[2]);
  memory::succeedAgain();
  require(status == fmi2Error, "no memory, but no error");
  row("fmi2Reset").call(session);
  Packed other = packed;
  other.guid = "{another}";
  session.free();
  const fmi2CallbackFunctions silent{};
  require(!fmi2Instantiate("leak", fmi2CoSimulation, other.guid.c_str(), packed.folder.c_str(), &silent, 0, 0),
          "a wrong GUID was taken");
}

}  // namespace

void testLeaks(const Packed& packed, long count) {
  live(packed);  // what the libraries keep for good
  const long before = memory::blocks();
  for (long i = 0; i < count; ++i) live(packed);
  const long more = memory::blocks() - before;
  require(more == 0,
          packed.folder + ": " + std::to_string(more) + " blocks more after " + std::to_string(count) + " instances");
}
