// The FMU as a caller holds it, by either standard: a packed scene, and instances with what they gave to keep.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

using References = std::vector<std::uint32_t>;
using Values = std::vector<double>;

enum Status : int { statusOk, statusWarning, statusDiscard, statusError };  // of both standards

// The first look at a defect ends the program with this line and status 1.
[[noreturn]] void fail(const std::string& what);
void require(bool truth, const std::string& what);

struct Standard;

struct Packed {
  Packed(std::string folder, const Standard& standard);  // of scene.bin

  std::string folder, guid;
  std::string path;  // the folder as FMI 3.0 names it
  const Standard& standard;
  // Value references: scalars of FMI 2.0, arrays of FMI 3.0.
  References inputs, outputs, parameters, calculated;
  References readable;  // all that hold floating-point numbers
  struct Other {
    std::uint32_t reference;
    std::size_t size;
    bool labels;  // strings, else node ids
  };
  std::vector<Other> others;
  std::size_t references() const { return first_.size() - 1; }
  Values startOf(const References& references) const;  // one after another; of unknown ones a zero

 private:
  void add(References& list, std::size_t size, const double* values);

  Values start_;                          // of all references
  std::vector<std::size_t> first_ = {0};  // where those of each begin
};

struct Message {
  int status;
  std::string category, text;
};

class Session {
 public:
  explicit Session(const Packed& packed, bool logging = false, bool asks = false);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  void instantiate(bool logging = false);  // `component` is null when it failed
  void free();

  const Packed& packed;
  const bool asks;        // is called back from the middle of steps, where the standard has that
  bool intrudes = false;  // does there what is not allowed
  double returns = std::numeric_limits<double>::infinity();  // from this time on has a step end there
  double end = 0;                                            // FMI 3.0: last successful time of the last step
  void* component = nullptr;
  std::vector<Message> log;
  std::vector<void*> saved = std::vector<void*>(3);                          // states given to keep
  std::vector<std::vector<char>> bytes = std::vector<std::vector<char>>(2);  // serialised states
  std::string result;                                                        // what the last call wrote

  void give(const void* data, std::size_t size);  // sets `result`
  template <class T> void give(const std::vector<T>& list) { give(list.data(), list.size() * sizeof(T)); }

  // Arguments of the calls in the table, there before the call: they must not allocate when memory fails.
  Values read, set, change, slope, changes, weights, gradient;
  std::vector<int> orders;
  std::vector<char> buffer;
};

enum State { instantiated, initializationMode, stepComplete, terminated, error };
constexpr int states = 5;

struct Row {
  const char* name;
  const char* allowed;    // one mark for each State
  int (*call)(Session&);  // with good arguments
  bool with(State state) const { return allowed[2 * state] == 'x'; }
};

// The calls on states: what a standard calls them, and how they are called.
struct StateCalls {
  const char *get, *set, *free, *size, *serialize, *deserialize;
  int (*getInto)(Session&, void** state);
  int (*setTo)(Session&, void* state);
  int (*freeAt)(Session&, void** state);
  int (*sizeOf)(Session&, void* state, std::size_t* size);
  int (*toBytes)(Session&, void* state, char* bytes, std::size_t size);
  int (*fromBytes)(Session&, const char* bytes, std::size_t size, void** state);
};

// One of each with good arguments, by either standard.
int getState(Session& session);
int setState(Session& session);
int freeState(Session& session);
int serializedSize(Session& session);
int serialize(Session& session);
int deserialize(Session& session);

// A standard: its table of functions, for the states that this FMU can be in, and what the tests do by either.
struct Standard {
  const char* stateName[states];
  std::vector<Row> rows;
  const char *enter, *exit, *terminate, *reset, *get, *instantiateName;
  std::vector<const char*> running;  // what a caller does in a run, for the most part
  std::vector<const char*> script;   // a life that does everything, in order
  std::vector<const char*> never;    // what those refusals say that depend on no state
  void (*instantiate)(Session&, const char* token, bool logging);
  void (*free)(Session&);
  int (*setInputs)(Session&, const Values& values);
  int (*step)(Session&, double time, double size);
  bool (*fails)(Session&, State believed);  // is it in the state `error` instead?
  StateCalls onStates;

  const Row& row(const std::string& name) const;
  int call(Session& session, const std::string& name) const { return row(name).call(session); }
};
extern const Standard fmi2, fmi3;

// Numbers from -0.25 to 0.25, others at each step.
Values wave(std::size_t count, int step);
// Inputs near their start values.
Values inputs(const Packed& packed, int step);

// Brings a new session's instance to a state.
void bring(Session& session, State state);
// From any state: everything that can be read, then a reset and a short run with all that it gives, as bytes.
std::string future(Session& session, State state);
