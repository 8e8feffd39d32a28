#include "memory.hpp"
#include "tests.hpp"

namespace {

// A life with states and messages that nobody frees, errors, and failed instantiations.
void live(const Packed& packed) {
  const Standard& by = packed.standard;
  Session session(packed, true, true);
  bring(session, stepComplete);
  for (const std::string name : by.script)
    if (name != by.terminate && name != by.reset) by.call(session, name);
  require(by.step(session, 1e9, 1) == statusError, "a step from elsewhere was taken");
  session.saved[2] = nullptr;
  memory::failAfter(0, memory::Throws::badAlloc);
  const int status = by.onStates.getInto(session, &session.saved[2]);
  memory::succeedAgain();
  require(status == statusError, "no memory, but no error");
  by.call(session, by.reset);
  session.free();
  by.instantiate(session, "{another}", false);
  require(!session.component, "a wrong token was taken");
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
