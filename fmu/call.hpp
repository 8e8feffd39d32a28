// A function of a standard, the states that it may be called in, and how it is called: no exception leaves the library.
#pragma once

#include <cstdio>
#include <cstring>
#include <exception>
#include <string>

#include "instance.hpp"

namespace tiefmu {

struct Call {
  const char* name;
  unsigned allowed;  // states, by their bits

  constexpr bool isAllowedIn(State state) const { return (allowed & static_cast<unsigned>(state)) != 0; }
};

// An instance name that is no name.
inline bool isBlank(const char* text) { return text[std::strspn(text, " \t\n\r\f\v")] == 0; }

// The bits of the states that are marked with x in a row of `states` marks.
consteval unsigned marked(const char* marks, unsigned states) {
  unsigned allowed = 0, bit = 1;
  for (; *marks; ++marks)
    if (*marks != ' ') {
      if (*marks == 'x') allowed |= bit;
      bit <<= 1;
    }
  return bit == 1u << states ? allowed : throw "a row has one mark for each state";
}

// Runs body(instance) where the call is allowed; false where it went wrong. That is logged; unless the call was merely
// refused, the instance is then in the state `error`, which only a reset and a saved state lead out of.
template <class Body>
bool succeeds(Instance* instance, const Call& call, const char* (*stateName)(State), Body body) noexcept {
  if (!instance) return false;
  const auto fail = [&](const char* message, State next) {
    char line[2000];  // no allocation: memory may be what is lacking
    std::snprintf(line, sizeof line, "%s: %s", call.name, message);
    instance->state = next;
    instance->log->write(Severity::error, Category::error, line);
    return false;
  };
  try {
    if (!call.isAllowedIn(instance->state))
      throw Refused(std::string("not allowed in state ") + stateName(instance->state));
    body(*instance);
    return true;
  } catch (const Refused& e) {
    return fail(e.what(), instance->state);
  } catch (const std::exception& e) {
    return fail(e.what(), State::error);
  } catch (...) {
    return fail("unknown exception", State::error);
  }
}

}  // namespace tiefmu
