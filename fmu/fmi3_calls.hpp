// Which function may be called in which state: FMI 3.0, sections 2.3 (common state machine) and 4.2 (co-simulation).
#pragma once

#include <bit>

#include "call.hpp"

namespace tiefmu::fmi3 {

constexpr const char* stateName(State state) {
  switch (state) {
    case State::instantiated: return "Instantiated";
    case State::initialization: return "Initialization Mode";
    case State::stepComplete: return "Step Mode";
    case State::inStep: return "Intermediate Update Mode";
    case State::terminated: return "Terminated";
    case State::error: return "error";
  }
  return "";
}

// Marks in the order of the bits of State, of which three belong to FMI 2.0 alone.
consteval unsigned row(const char* marks) {
  const unsigned m = marked(marks, 6);
  return (m & 15u) | (m & 48u) << 2;
}

// fmi3GetVersion, the instantiation and fmi3FreeInstance need no instance or end it, and are always allowed. After an
// error the standard leaves reset, states and the end; what can still be read may be, as in FMI 2.0.
namespace call {
// clang-format off
//                                                                         Instantiated
//                                                                         | Initialization Mode
//                                                                         | | Step Mode
//                                                                         | | | Intermediate Update Mode
//                                                                         | | | | Terminated
//                                                                         | | | | | error
constexpr Call setDebugLogging         {"fmi3SetDebugLogging",         row("x x x . x x")};
constexpr Call enterInitializationMode {"fmi3EnterInitializationMode", row("x . . . . .")};
constexpr Call exitInitializationMode  {"fmi3ExitInitializationMode",  row(". x . . . .")};
constexpr Call terminate               {"fmi3Terminate",               row(". . x . . .")};
constexpr Call reset                   {"fmi3Reset",                   row("x x x . x x")};
constexpr Call getFloat64              {"fmi3GetFloat64",              row(". x x x x x")};
constexpr Call getInt64                {"fmi3GetInt64",                row(". x x x x x")};
constexpr Call getString               {"fmi3GetString",               row(". x x x x x")};
constexpr Call setFloat64              {"fmi3SetFloat64",              row("x x x x . .")};
constexpr Call getFMUState             {"fmi3GetFMUState",             row("x x x . x x")};
constexpr Call setFMUState             {"fmi3SetFMUState",             row("x x x . x x")};
constexpr Call freeFMUState            {"fmi3FreeFMUState",            row("x x x . x x")};
constexpr Call serializedFMUStateSize  {"fmi3SerializedFMUStateSize",  row("x x x . x x")};
constexpr Call serializeFMUState       {"fmi3SerializeFMUState",       row("x x x . x x")};
constexpr Call deserializeFMUState     {"fmi3DeserializeFMUState",     row("x x x . x x")};
constexpr Call getNumberOfDependencies {"fmi3GetNumberOfVariableDependencies", row("x x x . x x")};
constexpr Call getDependencies         {"fmi3GetVariableDependencies", row("x x x . x x")};
constexpr Call getDirectionalDerivative{"fmi3GetDirectionalDerivative",row(". x x . x x")};
constexpr Call getAdjointDerivative    {"fmi3GetAdjointDerivative",    row(". x x . x x")};
constexpr Call getOutputDerivatives    {"fmi3GetOutputDerivatives",    row(". . x . x x")};
constexpr Call doStep                  {"fmi3DoStep",                  row(". . x . . .")};
// clang-format on
}  // namespace call

}  // namespace tiefmu::fmi3
