#include <algorithm>

#include "tests.hpp"

void testStates(const Packed& packed) {
  const Standard& by = packed.standard;
  for (int s = 0; s < states; ++s) {
    const auto state = static_cast<State>(s);
    for (const Row& r : by.rows) {
      const std::string where = packed.folder + ": " + r.name + " in state " + by.stateName[state];
      Session session(packed), undisturbed(packed);
      bring(session, state);
      bring(undisturbed, state);
      const int status = r.call(session);
      if (r.with(state)) {
        require(status == statusOk || status == statusDiscard,
                where + ": refused: " + (session.log.empty() ? "" : session.log[0].text));
        require(session.log.empty(), where + ": a message, but no error");
        continue;
      }
      require(status == statusError, where + ": not refused");
      require(session.log.size() == 1 && session.log[0].status == statusError &&
                  session.log[0].category == "logStatusError",
              where + ": not one message of an error");
      const std::string& text = session.log[0].text;
      const std::string begin = std::string(r.name) + ": ";
      require(text == begin + "not allowed in state " + by.stateName[state] ||
                  std::any_of(by.never.begin(), by.never.end(), [&](const char* why) { return text == begin + why; }),
              where + ": says '" + text + "'");
      // What can be read in the state `instantiated` comes after it.
      require(future(session, state) == future(undisturbed, state), where + ": changed what comes after it");
    }
  }
}
