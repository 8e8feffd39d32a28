// Which function may be called in which state: FMI 2.0, section 4.2.4 (state machine for co-simulation).
#pragma once

#include <bit>
#include <iterator>

#include "call.hpp"

namespace tiefmu::fmi2 {

// Names of the states, in the order of their bits. Those that no State of ours stands for are never entered: fmi2DoStep
// returns when the step is done, and discards none.
inline constexpr const char* stateNames[] = {"instantiated", "initializationMode", "stepComplete", "stepInProgress",
                                             "stepFailed",   "stepCanceled",       "terminated",   "error",
                                             "fatal"};

constexpr const char* stateName(State state) { return stateNames[std::countr_zero(static_cast<unsigned>(state))]; }

consteval unsigned row(const char* marks) { return marked(marks, std::size(stateNames)); }

// fmi2GetTypesPlatform, fmi2GetVersion, fmi2Instantiate and fmi2FreeInstance need no instance or end it, and are
// always allowed.
namespace call {
// clang-format off
//                                                                           instantiated
//                                                                           | initializationMode
//                                                                           | | stepComplete
//                                                                           | | | stepInProgress
//                                                                           | | | | stepFailed
//                                                                           | | | | | stepCanceled
//                                                                           | | | | | | terminated
//                                                                           | | | | | | | error
//                                                                           | | | | | | | | fatal
constexpr Call setDebugLogging         {"fmi2SetDebugLogging",          row("x x x x x x x x .")};
constexpr Call setupExperiment         {"fmi2SetupExperiment",          row("x . . . . . . . .")};
constexpr Call enterInitializationMode {"fmi2EnterInitializationMode",  row("x . . . . . . . .")};
constexpr Call exitInitializationMode  {"fmi2ExitInitializationMode",   row(". x . . . . . . .")};
constexpr Call terminate               {"fmi2Terminate",                row(". . x . x . . . .")};
constexpr Call reset                   {"fmi2Reset",                    row("x x x . x x x x .")};
constexpr Call getReal                 {"fmi2GetReal",                  row(". x x . x x x x .")};
constexpr Call getInteger              {"fmi2GetInteger",               row(". x x . x x x x .")};
constexpr Call getBoolean              {"fmi2GetBoolean",               row(". x x . x x x x .")};
constexpr Call getString               {"fmi2GetString",                row(". x x . x x x x .")};
constexpr Call setReal                 {"fmi2SetReal",                  row("x x x . . . . . .")};
constexpr Call setInteger              {"fmi2SetInteger",               row("x x x . . . . . .")};
constexpr Call setBoolean              {"fmi2SetBoolean",               row("x x x . . . . . .")};
constexpr Call setString               {"fmi2SetString",                row("x x x . . . . . .")};
constexpr Call getFMUstate             {"fmi2GetFMUstate",              row("x x x . x x x x .")};
constexpr Call setFMUstate             {"fmi2SetFMUstate",              row("x x x . x x x x .")};
constexpr Call freeFMUstate            {"fmi2FreeFMUstate",             row("x x x . x x x x .")};
constexpr Call serializedFMUstateSize  {"fmi2SerializedFMUstateSize",   row("x x x . x x x x .")};
constexpr Call serializeFMUstate       {"fmi2SerializeFMUstate",        row("x x x . x x x x .")};
constexpr Call deSerializeFMUstate     {"fmi2DeSerializeFMUstate",      row("x x x . x x x x .")};
constexpr Call getDirectionalDerivative{"fmi2GetDirectionalDerivative", row(". x x . x x x x .")};
constexpr Call setRealInputDerivatives {"fmi2SetRealInputDerivatives",  row("x x x . . . . . .")};
constexpr Call getRealOutputDerivatives{"fmi2GetRealOutputDerivatives", row(". . x . x x x x .")};
constexpr Call doStep                  {"fmi2DoStep",                   row(". . x . . . . . .")};
constexpr Call cancelStep              {"fmi2CancelStep",               row(". . . x . . . . .")};
constexpr Call getStatus               {"fmi2GetStatus",                row(". . x x x . x . .")};
constexpr Call getRealStatus           {"fmi2GetRealStatus",            row(". . x x x . x . .")};
constexpr Call getIntegerStatus        {"fmi2GetIntegerStatus",         row(". . x x x . x . .")};
constexpr Call getBooleanStatus        {"fmi2GetBooleanStatus",         row(". . x x x . x . .")};
constexpr Call getStringStatus         {"fmi2GetStringStatus",          row(". . x x x . x . .")};
// clang-format on
}  // namespace call

}  // namespace tiefmu::fmi2
