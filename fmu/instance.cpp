#include "instance.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace tiefmu {
namespace {

// Adding the lowest exponent bit to an exponent of ones, which infinities and NaN have, carries into the sign bit.
bool allFinite(const double* values, std::size_t count) {
  constexpr std::uint64_t exponent = 0x7ff0000000000000, lowest = 0x0010000000000000;
  std::uint64_t carry = 0;
  for (std::size_t i = 0; i < count; ++i) carry |= (std::bit_cast<std::uint64_t>(values[i]) & exponent) + lowest;
  return carry >> 63 == 0;
}

void copy(const double* from, std::size_t count, double* to) {
  if (count < 4)  // shorter than the call of memcpy
    for (std::size_t i = 0; i < count; ++i) to[i] = from[i];
  else
    std::memcpy(to, from, count * sizeof(double));
}

std::string text(double number) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.9g", number);
  return buffer;
}

// Communication points are sums of steps that the master may round in another order than we do; but a missed or
// repeated step is always seen.
double tolerance(double time, double step) { return 1e-12 * std::abs(time) + 1e-3 * step; }

}  // namespace

Instance::Instance(std::unique_ptr<Log> instanceLog, Resource resource)
    : log(std::move(instanceLog)),
      guid(std::move(resource.guid)),
      simulation(std::make_shared<const Model>(std::move(resource.model))) {
  for (const Block& b : variables(simulation.model(), simulation.layout())) {
    references = b.reference + static_cast<std::uint32_t>(b.count());
    const bool continues = !ranges.empty() && ranges.back().causality == b.causality &&
                           ranges.back().place + (ranges.back().end - ranges.back().first) == b.place;
    if (continues)
      ranges.back().end = references;
    else
      ranges.push_back({b.reference, references, b.causality, b.place});
  }
  std::uint32_t range = 0;
  for (std::uint32_t r = 0; r < references; r += 64) {
    while (r >= ranges[range].end) ++range;
    firstRange.push_back(range);
  }
}

void Instance::setupExperiment(double startTime, bool stopTimeDefined, double stopTime) {
  if (!std::isfinite(startTime)) throw Refused("the start time is not a finite number");
  if (stopTimeDefined && !(stopTime >= startTime)) throw Refused("the stop time is not after the start time");
  clock = {startTime, stopTime, stopTimeDefined};
}

void Instance::enterInitializationMode() {
  if (log->wants(Category::tie))
    for (const Finding& f : simulation.model().findings)
      log->write(f.kind == Finding::warning ? Severity::warning : Severity::note, Category::tie, f.text.c_str());
  state = State::initialization;
}

void Instance::exitInitializationMode() {
  simulation.initialise(clock.time);
  if (simulation.model().anyFree() && log->wants(Category::stability)) {
    const std::string message = "stable time step " + text(*simulation.field(Field::stableTimeStep)) +
                                " s, nodal time step " + text(*simulation.field(Field::nodalTimeStep)) +
                                " s, limit of the integrator " + text(simulation.integratorLimit()) + " s";
    log->write(Severity::note, Category::stability, message.c_str());
  }
  host = hostStep(simulation);
  state = State::stepComplete;
}

void Instance::warnOfStep(double step) {
  if (warnedOfStep || !log->wants(Category::stability)) return;
  warnedOfStep = true;
  const Model& model = simulation.model();
  const std::string whose = host.port >= 0 ? "port '" + model.ports[static_cast<std::size_t>(host.port)].name + "'"
                                           : "driven master node " + std::to_string(model.nodeId[host.node]);
  const std::string message = "the communication step " + text(step) + " s is longer than the nodal time step " +
                              text(host.step) + " s of " + whose + ": an explicit host is unstable with it";
  log->write(Severity::warning, Category::stability, message.c_str());
}

void Instance::reset() {
  simulation.reset();
  clock = {};
  host = {};
  warnedOfStep = false;
  state = State::instantiated;
}

const Instance::Range& Instance::rangeOf(std::uint32_t reference) const {
  if (reference >= references)
    throw Refused("unknown value reference " + std::to_string(reference) + "; there are " + std::to_string(references));
  const Range* range = &ranges[firstRange[reference / 64]];
  while (reference >= range->end) ++range;
  return *range;
}

std::string Instance::nameOf(std::uint32_t reference) const {
  for (const Block& b : variables(simulation.model(), simulation.layout()))
    if (reference - b.reference < b.count()) {
      const std::uint32_t offset = reference - b.reference, components = static_cast<std::uint32_t>(b.components);
      return variableName(b, offset / components, static_cast<int>(offset % components));
    }
  return {};
}

void Instance::get(const std::uint32_t refs[], std::size_t count, double values[]) {
  if (count > 0 && !values) throw Refused("the array of values is a null pointer");
  try {
    simulation.updateOutputs();
  } catch (const std::exception&) {
    forRuns(refs, count, [](const Range&, std::uint32_t, std::size_t, std::size_t) {});  // what is refused comes first
    if (state != State::error) throw;  // there what still can be read is
  }
  const double* data = simulation.data();
  forRuns(refs, count, [&](const Range& range, std::uint32_t first, std::size_t run, std::size_t i) {
    copy(data + range.place + (first - range.first), run, values + i);
  });
}

void Instance::refuseToSet(const Range& range, std::uint32_t reference) const {
  const char* why = range.causality == Causality::parameter             ? "is fixed after the initialisation"
                    : range.causality == Causality::calculatedParameter ? "is calculated"
                                                                        : "is an output";
  throw Refused("variable '" + nameOf(reference) + "' " + why + " and cannot be set");
}

// `first` is the reference of values[0]; one of the values from there on is not finite.
void Instance::refuseValue(std::uint32_t first, const double* values) const {
  std::uint32_t bad = 0;
  while (std::isfinite(values[bad])) ++bad;
  throw Refused("variable '" + nameOf(first + bad) + "' cannot be set to " +
                (std::isnan(values[bad]) ? "NaN" : "an infinite value"));
}

void Instance::get(const std::vector<Span>& spans, double values[]) {
  try {
    simulation.updateOutputs();
  } catch (const std::exception&) {
    if (state != State::error) throw;
  }
  for (const Span& s : spans) {
    copy(simulation.data() + s.place, s.count, values);
    values += s.count;
  }
}

void Instance::prepareRun(const Range& range, std::uint32_t first, std::size_t count, const double* from,
                          Changed& changed) {
  double* to = simulation.data() + range.place + (first - range.first);
  if (range.causality == Causality::input)
    changed.inputs = true;
  else if (range.causality == Causality::parameter && state != State::stepComplete && state != State::inStep)
    changed.parameters = true;
  else if (range.causality != Causality::parameter)
    refuseToSet(range, first);
  else  // the value that it has may be set again: some importers set all parameters before every run
    for (std::size_t k = 0; k < count; ++k)
      if (from[k] != to[k]) refuseToSet(range, first + static_cast<std::uint32_t>(k));
  if (!allFinite(from, count)) refuseValue(first, from);
  runs.push_back({from, to, count});
}

void Instance::copyRuns(Changed changed) {
  for (const Run& run : runs) copy(run.from, run.count, run.to);
  if (changed.parameters) simulation.parametersChanged();
  if (changed.inputs) simulation.inputsChanged();
}

// First all checks: a refused call changes nothing.
void Instance::set(const std::uint32_t refs[], std::size_t count, const double values[]) {
  if (count > 0 && !values) throw Refused("the array of values is a null pointer");
  Changed changed;
  runs.clear();
  forRuns(refs, count, [&](const Range& range, std::uint32_t first, std::size_t run, std::size_t i) {
    prepareRun(range, first, run, values + i, changed);
  });
  copyRuns(changed);
}

void Instance::set(const std::vector<Span>& spans, const double values[]) {
  Changed changed;
  runs.clear();
  for (const Span& s : spans) {
    prepareRun(rangeOf(s.first), s.first, s.count, values, changed);
    values += s.count;
  }
  copyRuns(changed);
}

void Instance::checkStep(double point, double step) {
  if (!(step > 0) || !std::isfinite(step) || std::isinf(point + step))
    throw Refused("the step size " + text(step) + " s is not above zero and finite");
  const double allowed = tolerance(clock.time, step);
  if (!(std::abs(point - clock.time) <= allowed))
    throw Refused("the step starts at " + text(point) + " s, but the instance stands at " + text(clock.time) + " s");
  if (clock.stopDefined && point + step > clock.stop + allowed)
    throw Refused("the step ends at " + text(point + step) + " s, after the stop time " + text(clock.stop) + " s");
  if (point + step == point)
    throw Refused("the step size " + text(step) + " s is too small to move the time on from " + text(point) + " s");
  if (step > host.step) warnOfStep(step);
}

double Instance::substepsOf(double step) const {
  try {
    return simulation.substepsOf(step);
  } catch (const StepTooLong& e) {
    throw Refused(e.what());
  }
}

void Instance::doStep(double point, double step) {
  checkStep(point, step);
  try {
    simulation.step(step);
  } catch (const StepTooLong& e) {
    throw Refused(e.what());
  } catch (const Diverged& e) {
    for (const Range& r : ranges)
      if (e.place >= r.place && e.place - r.place < r.end - r.first)
        throw Diverged(e.what() +
                       ("; variable '" + nameOf(r.first + static_cast<std::uint32_t>(e.place - r.place)) + "'"));
    throw;
  }
  clock.time = point + step;  // the master's sum, so that rounding does not pull the two apart
}

}  // namespace tiefmu
