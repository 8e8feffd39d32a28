#include "tests.hpp"

void testStates(const Packed& packed) {
  for (int s = 0; s < states; ++s) {
    const auto state = static_cast<State>(s);
    for (const Row& r : standard) {
      const std::string where = packed.folder + ": " + r.name + " in state " + stateName(state);
      Session session(packed), undisturbed(packed);
      bring(session, state);
      bring(undisturbed, state);
      const fmi2Status status = r.call(session);
      if (r.with(state)) {
        require(status == fmi2OK || status == fmi2Discard,
                where + ": refused: " + (session.log.empty() ? "" : session.log[0].text));
        require(session.log.empty(), where + ": a message, but no error");
        continue;
      }
      require(status == fmi2Error, where + ": not refused");
      require(
          session.log.size() == 1 && session.log[0].status == fmi2Error && session.log[0].category == "logStatusError",
          where + ": not one message of an error");
      const std::string& text = session.log[0].text;
      const std::string begin = std::string(r.name) + ": ";
      require(text == begin + "not allowed in state " + stateName(state) ||
                  text == begin + "only co-simulation is supported",
              where + ": says '" + text + "'");
      // What can be read in the state `instantiated` comes after it.
      require(future(session, state) == future(undisturbed, state), where + ": changed what comes after it");
    }
  }
}
