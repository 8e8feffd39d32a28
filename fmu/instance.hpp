// One FMU instance: a simulation, where its variables stand, its state, and its logger.
#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#include "../modelDescription/resource.hpp"
#include "../modelDescription/variables.hpp"
#include "saved_state.hpp"

extern "C" {
#include "fmi2FunctionTypes.h"
}

namespace tiefmu {

// A call that is refused: the instance is as before. Every other exception puts it into the state `error`.
struct Refused : std::runtime_error { using std::runtime_error::runtime_error; };

// Indexes of logCategories.
enum class Category { error, warning, tie, stability, all };

// Copied from the caller's callbacks; the environment goes back to it with every message.
struct Logger {
  fmi2CallbackLogger callback = nullptr;
  fmi2ComponentEnvironment environment = nullptr;
  std::string instanceName;
  bool on = false;
  unsigned categories = ~0u;  // bit i: category i

  bool wants(Category category) const;
  // Errors are logged always. Does not throw.
  void write(fmi2Status status, Category category, const char* message) const noexcept;
};

// Path of a file in the resource folder, from its location as fmi2Instantiate gets it: a file URI or a plain path.
std::string resourcePath(const std::string& location, const char* file);

// Throws ResourceError (also when the file cannot be read, or belongs to another GUID).
Resource loadResource(const std::string& location, const std::string& guid);

// How many of `count` references ascend by one from the first.
inline std::size_t runLength(const fmi2ValueReference refs[], std::size_t count) {
  constexpr std::size_t stride = 16;  // compared at once, without a branch each
  const std::uint32_t first = refs[0];
  std::size_t run = 1;
  if (count == 1 || refs[1] != first + 1) return run;
  while (run + stride <= count) {
    std::uint32_t differs = 0;
    for (std::size_t j = 0; j < stride; ++j) differs |= refs[run + j] ^ (first + static_cast<std::uint32_t>(run + j));
    if (differs) break;
    run += stride;
  }
  while (run < count && refs[run] == first + run) ++run;
  return run;
}

class Instance {
 public:
  Instance(Logger instanceLogger, Resource resource);

  State state = instantiated;
  Logger logger;

  void setDebugLogging(bool on, std::size_t count, const fmi2String categories[]);
  void setupExperiment(double startTime, bool stopTimeDefined, double stopTime);
  void enterInitializationMode();
  void exitInitializationMode();
  void reset();
  void get(const fmi2ValueReference references[], std::size_t count, double values[]);
  void set(const fmi2ValueReference references[], std::size_t count, const double values[]);
  void doStep(double currentCommunicationPoint, double communicationStepSize);
  double time() const { return clock.time; }

  void getState(fmi2FMUstate* saved);
  void setState(fmi2FMUstate saved);
  void freeState(fmi2FMUstate* saved);
  std::size_t serializedStateSize(fmi2FMUstate saved) const;
  void serializeState(fmi2FMUstate saved, fmi2Byte bytes[], std::size_t size) const;
  // `saved`: a state of this instance to overwrite, or anything else, which a new state replaces.
  void deserializeState(const fmi2Byte bytes[], std::size_t size, fmi2FMUstate* saved);

  // change[k] = sum over l of d unknown[k] / d known[l] * seed[l], for outputs and inputs.
  void directionalDerivative(const fmi2ValueReference unknown[], std::size_t unknowns, const fmi2ValueReference known[],
                             std::size_t knowns, const double seed[], double change[]);
  void setInputDerivatives(const fmi2ValueReference references[], std::size_t count, const fmi2Integer orders[],
                           const double values[]);
  void outputDerivatives(const fmi2ValueReference references[], std::size_t count, const fmi2Integer orders[],
                         double values[]);

 private:
  // References [first, end) stand at places [place, ...) of the simulation's array.
  struct Range {
    std::uint32_t first, end;
    Causality causality;
    std::size_t place;
  };

  // Values on their way to the array.
  struct Run {
    const double* from;
    double* to;
    std::size_t count;
  };

  const Range& rangeOf(std::uint32_t reference) const;
  [[noreturn]] void refuseToSet(const Range& range, std::uint32_t reference) const;
  [[noreturn]] void refuseValue(std::uint32_t first, const double* values) const;
  std::string nameOf(std::uint32_t reference) const;
  SavedState& known(fmi2FMUstate saved) const;
  void keep(fmi2FMUstate* saved, std::unique_ptr<SavedState> fresh);
  // Calls use(range, first reference, number, index of the first) for each run of consecutive references.
  template <class Use> void forRuns(const fmi2ValueReference references[], std::size_t count, Use use) const;
  void require(const Range& range, std::uint32_t reference, Causality causality) const;
  std::size_t inputAt(std::uint32_t reference) const;  // its place
  void requireOutputs(const fmi2ValueReference references[], std::size_t count) const;
  void takeScratch(const fmi2ValueReference references[], std::size_t count, double values[]) const;
  void findHostStep();
  void warnOfStep(double step);

  std::string guid;
  Simulation simulation;
  std::vector<Range> ranges;
  std::vector<std::uint32_t> firstRange;  // range of every 64th reference
  std::uint32_t references = 0;
  std::vector<Run> runs;        // of the present fmi2SetReal
  std::vector<double> scratch;  // laid out like the simulation's array
  Clock clock;
  double hostStep = std::numeric_limits<double>::infinity();  // the least that a driven master's stiffness allows, s
  int hostNode = 0, hostPort = -1;                            // whose it is: a port's, else the node's
  bool warnedOfStep = false;
  std::unordered_map<fmi2FMUstate, std::unique_ptr<SavedState>> savedStates;
};

template <class Use> void Instance::forRuns(const fmi2ValueReference refs[], std::size_t count, Use use) const {
  if (count > 0 && !refs) throw Refused("the array of value references is a null pointer");
  for (std::size_t i = 0; i < count;) {
    const std::uint32_t first = refs[i];
    const Range& range = rangeOf(first);
    const std::size_t most = std::min<std::size_t>(count - i, range.end - first);
    const std::size_t run = runLength(refs + i, most);
    use(range, first, run, i);
    i += run;
  }
}

}  // namespace tiefmu
