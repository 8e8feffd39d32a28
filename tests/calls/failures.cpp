#include "memory.hpp"
#include "tests.hpp"

namespace {

using memory::Throws;

// The calls of a life that does everything, in order.
const char* const script[] = {"fmi2SetDebugLogging",
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
                              "fmi2Reset"};
constexpr std::size_t scriptLength = sizeof script / sizeof *script;

// What the caller must keep: an error is an error, a message says so, and a reset heals.
void check(Session& session, const Row& r, fmi2Status status, const std::string& healthy, const std::string& where) {
  if (status != fmi2Error) {
    require(status == fmi2OK || status == fmi2Discard, where + ": status " + std::to_string(status));
  } else {
    require(!session.log.empty(), where + ": an error without a message");
    const std::string begin = std::string(r.name) + ": ";
    require(session.log.back().status == fmi2Error && session.log.back().text.compare(0, begin.size(), begin) == 0,
            where + ": says '" + session.log.back().text + "'");
  }
  require(fmi2Reset(session.component) == fmi2OK, where + ": no reset");
  require(future(session, instantiated) == healthy, where + ": another run after a reset");
}

void failCall(const Packed& packed, std::size_t index, Throws what, bool all, const std::string& healthy) {
  const Row& r = row(script[index]);
  for (long successes = 0;; successes += 1 + successes / 40) {
    Session session(packed);
    bring(session, instantiated);
    for (std::size_t i = 0; i < index; ++i) row(script[i]).call(session);
    session.log.clear();
    memory::failAfter(successes, what, all);
    const fmi2Status status = r.call(session);
    const bool failed = memory::succeedAgain();
    if (!failed) return;
    check(session, r, status, healthy,
          packed.folder + ": " + r.name + " (call " + std::to_string(index) + "), allocation " +
              std::to_string(successes) + " fails");
  }
}

void failInstantiation(const Packed& packed, Throws what, bool all) {
  Session session(packed);
  for (long successes = 0;; successes += 1 + successes / 40) {
    session.free();
    std::vector<Message>().swap(session.log);
    const long before = memory::blocks();
    memory::failAfter(successes, what, all);
    session.instantiate();
    if (!memory::succeedAgain()) return;
    if (session.component) continue;
    const std::size_t messages = session.log.size();
    std::vector<Message>().swap(session.log);
    const long lost = memory::blocks() - before;
    const std::string where = packed.folder + ": fmi2Instantiate, allocation " + std::to_string(successes) + " fails";
    require(messages == 1, where + ": not one message");
    require(lost <= 0, where + ": memory lost");
  }
}

}  // namespace

void testFailures(const Packed& packed) {
  Session session(packed);
  const std::string healthy = future(session, instantiated);
  for (const auto& [what, all] : {std::pair{Throws::badAlloc, false}, std::pair{Throws::badAlloc, true},
                                  std::pair{Throws::exception, false}, std::pair{Throws::number, false}}) {
    failInstantiation(packed, what, all);
    for (std::size_t i = 0; i < scriptLength; ++i) failCall(packed, i, what, all, healthy);
  }
}
