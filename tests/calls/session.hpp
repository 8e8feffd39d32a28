// The FMU as a caller holds it: a packed scene, and instances with what they gave to keep.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

extern "C" {
#include "fmi2Functions.h"
}

using References = std::vector<fmi2ValueReference>;
using Values = std::vector<fmi2Real>;

// The first look at a defect ends the program with this line and status 1.
[[noreturn]] void fail(const std::string& what);
void require(bool truth, const std::string& what);

struct Packed {
  explicit Packed(std::string folder);  // of scene.bin

  std::string folder, guid;
  References inputs, outputs, parameters, calculated;
  Values start;  // of every reference
};

struct Message {
  fmi2Status status;
  std::string category, text;
};

class Session {
 public:
  explicit Session(const Packed& packed, bool logging = false);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  void instantiate(bool logging = false);  // `component` is null when it failed
  void free();

  const Packed& packed;
  fmi2Component component = nullptr;
  std::vector<Message> log;
  std::vector<fmi2FMUstate> saved = std::vector<fmi2FMUstate>(3);                    // states given to keep
  std::vector<std::vector<fmi2Byte>> bytes = std::vector<std::vector<fmi2Byte>>(2);  // serialised states
  std::string result;                                                                // what the last call wrote

  void give(const void* data, std::size_t size);  // sets `result`

  // Arguments of the calls in `standard`, there before the call: they must not allocate when memory fails.
  References all;
  Values read, set, change, slope, changes;
  std::vector<fmi2Integer> orders;
  std::vector<fmi2Byte> buffer;
};

enum State { instantiated, initializationMode, stepComplete, terminated, error };
constexpr int states = 5;
const char* stateName(State state);

// FMI 2.0, table in section 4.2.4, for the states that this FMU can be in.
struct Row {
  const char* name;
  const char* allowed;           // one mark for each State
  fmi2Status (*call)(Session&);  // with good arguments
  bool with(State state) const { return allowed[2 * state] == 'x'; }
};
extern const std::vector<Row> standard;
const Row& row(const std::string& name);

// Brings a new session's instance to a state.
void bring(Session& session, State state);
// From any state: everything that can be read, then a reset and a short run with all that it gives, as bytes.
std::string future(Session& session, State state);
