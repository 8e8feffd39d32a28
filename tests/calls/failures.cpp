#include "memory.hpp"
#include "tests.hpp"

namespace {

using memory::Throws;

// What the caller must keep: an error is an error, a message says so, and a reset heals.
void check(Session& session, const Row& r, int status, const std::string& healthy, const std::string& where) {
  if (status != statusError) {
    require(status == statusOk || status == statusDiscard, where + ": status " + std::to_string(status));
  } else {
    require(!session.log.empty(), where + ": an error without a message");
    const std::string begin = std::string(r.name) + ": ";
    require(session.log.back().status == statusError && session.log.back().text.compare(0, begin.size(), begin) == 0,
            where + ": says '" + session.log.back().text + "'");
  }
  const Standard& by = session.packed.standard;
  require(by.call(session, by.reset) == statusOk, where + ": no reset");
  require(future(session, instantiated) == healthy, where + ": another run after a reset");
}

void failCall(const Packed& packed, std::size_t index, Throws what, bool all, const std::string& healthy) {
  const Standard& by = packed.standard;
  const Row& r = by.row(by.script[index]);
  for (long successes = 0;; successes += 1 + successes / 40) {
    Session session(packed, false, true);
    bring(session, instantiated);
    for (std::size_t i = 0; i < index; ++i) by.call(session, by.script[i]);
    session.log.clear();
    memory::failAfter(successes, what, all);
    const int status = r.call(session);
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
    const std::string where =
        packed.folder + ": " + packed.standard.instantiateName + ", allocation " + std::to_string(successes) + " fails";
    require(messages == 1, where + ": not one message");
    require(lost <= 0, where + ": memory lost");
  }
}

}  // namespace

void testFailures(const Packed& packed) {
  Session session(packed, false, true);
  const std::string healthy = future(session, instantiated);
  for (const auto& [what, all] : {std::pair{Throws::badAlloc, false}, std::pair{Throws::badAlloc, true},
                                  std::pair{Throws::exception, false}, std::pair{Throws::number, false}}) {
    failInstantiation(packed, what, all);
    for (std::size_t i = 0; i < packed.standard.script.size(); ++i) failCall(packed, i, what, all, healthy);
  }
}
