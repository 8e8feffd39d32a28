// One FMU instance: a simulation, where its variables stand, its state, and its log. It knows no FMI standard: their
// functions (fmi2_functions.cpp) check what may be called when, and pass their arrays on.
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "../modelDescription/arrays.hpp"
#include "../src/host_step.hpp"
#include "log.hpp"
#include "refused.hpp"
#include "resource.hpp"
#include "saved_state.hpp"
#include "state.hpp"

namespace tiefmu {

// How many of `count` references ascend by one from the first.
inline std::size_t runLength(const std::uint32_t refs[], std::size_t count) {
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
  Instance(std::unique_ptr<Log> instanceLog, Resource resource);

  State state = State::instantiated;
  std::unique_ptr<Log> log;

  void setupExperiment(double startTime, bool stopTimeDefined, double stopTime);
  void enterInitializationMode();
  void exitInitializationMode();
  void reset();
  void get(const std::uint32_t references[], std::size_t count, double values[]);
  void set(const std::uint32_t references[], std::size_t count, const double values[]);
  // The same for whole spans, whose values follow each other in `values`.
  void get(const std::vector<Span>& spans, double values[]);
  void set(const std::vector<Span>& spans, const double values[]);
  void doStep(double currentCommunicationPoint, double communicationStepSize);
  // What it checks before anything changes; for a step that is done in parts.
  void checkStep(double currentCommunicationPoint, double communicationStepSize);
  double substepsOf(double step) const;  // the simulation's; throws Refused
  const Model& model() const { return simulation.model(); }
  std::vector<Block> blocks() const { return variables(simulation.model(), simulation.layout()); }
  double time() const { return clock.time; }

  // Saved states are handles that the instance owns until `freeState`, or until its end.
  void getState(void** saved);  // into *saved, or into a new one where that is null
  void setState(void* saved);
  void freeState(void** saved);
  std::size_t serializedStateSize(void* saved) const;
  void serializeState(void* saved, char bytes[], std::size_t size) const;
  // `saved`: a state of this instance to overwrite, or anything else, which a new state replaces.
  void deserializeState(const char bytes[], std::size_t size, void** saved);

  // change[k] = sum over l of d unknown[k] / d known[l] * seed[l], for outputs and inputs.
  void directionalDerivative(const std::uint32_t unknown[], std::size_t unknowns, const std::uint32_t known[],
                             std::size_t knowns, const double seed[], double change[]);
  // The same for whole spans, whose values follow each other; or transposed: result[l] = sum over k of seed[k] *
  // d unknown[k] / d known[l].
  void derivative(Way way, const std::vector<Span>& unknowns, const std::vector<Span>& knowns, const double seed[],
                  double result[]);
  void setInputDerivatives(const std::uint32_t references[], std::size_t count, const int orders[],
                           const double values[]);
  void outputDerivatives(const std::uint32_t references[], std::size_t count, const int orders[], double values[]);
  // The same for whole spans; `count`: of the orders.
  void outputDerivatives(const std::vector<Span>& outputs, const int orders[], std::size_t count, double values[]);

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

  struct Changed { bool parameters = false, inputs = false; };

  const Range& rangeOf(std::uint32_t reference) const;
  // Throws Refused, or puts down a run that `copyRuns` then takes over.
  void prepareRun(const Range& range, std::uint32_t first, std::size_t count, const double* from, Changed& changed);
  void copyRuns(Changed changed);
  [[noreturn]] void refuseToSet(const Range& range, std::uint32_t reference) const;
  [[noreturn]] void refuseValue(std::uint32_t first, const double* values) const;
  std::string nameOf(std::uint32_t reference) const;
  SavedState& known(void* saved) const;
  void keep(void** saved, std::unique_ptr<SavedState> fresh);
  // Calls use(range, first reference, number, index of the first) for each run of consecutive references.
  template <class Use> void forRuns(const std::uint32_t references[], std::size_t count, Use use) const;
  void require(const Range& range, std::uint32_t reference, Causality causality) const;
  std::size_t inputAt(std::uint32_t reference) const;  // its place
  std::vector<Span> spansOf(const std::uint32_t references[], std::size_t count) const;
  void takeScratch(const std::vector<Span>& spans, double values[]) const;
  void warnOfStep(double step);

  std::string guid;
  Simulation simulation;
  std::vector<Range> ranges;
  std::vector<std::uint32_t> firstRange;  // range of every 64th reference
  std::uint32_t references = 0;
  std::vector<Run> runs;        // of the present call of set
  std::vector<double> scratch;  // laid out like the simulation's array
  Clock clock;
  HostStep host;  // the least that a driven master's stiffness allows
  bool warnedOfStep = false;
  std::unordered_map<void*, std::unique_ptr<SavedState>> savedStates;
};

template <class Use> void Instance::forRuns(const std::uint32_t refs[], std::size_t count, Use use) const {
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
