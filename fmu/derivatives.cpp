// Derivatives of outputs with respect to inputs, and of inputs and outputs with respect to time.
#include <algorithm>
#include <cmath>

#include "instance.hpp"

namespace tiefmu {

void Instance::require(const Range& range, std::uint32_t reference, Causality causality) const {
  if (range.causality != causality)
    throw Refused("variable '" + nameOf(reference) + "' is not an " +
                  (causality == Causality::input ? "input" : "output"));
}

std::size_t Instance::inputAt(std::uint32_t reference) const {
  const Range& range = rangeOf(reference);
  require(range, reference, Causality::input);
  return range.place + (reference - range.first);
}

std::vector<Span> Instance::spansOf(const std::uint32_t refs[], std::size_t count) const {
  std::vector<Span> spans;
  forRuns(refs, count, [&](const Range& range, std::uint32_t first, std::size_t run, std::size_t) {
    spans.push_back({first, run, range.place + (first - range.first)});
  });
  return spans;
}

void Instance::takeScratch(const std::vector<Span>& spans, double values[]) const {
  for (const Span& s : spans)
    values = std::copy_n(scratch.begin() + static_cast<std::ptrdiff_t>(s.place), s.count, values);
}

void Instance::directionalDerivative(const std::uint32_t unknown[], std::size_t unknowns, const std::uint32_t known[],
                                     std::size_t knowns, const double seed[], double change[]) {
  if ((unknowns > 0 && !change) || (knowns > 0 && !seed)) throw Refused("an array of values is a null pointer");
  const std::vector<Span> of = spansOf(unknown, unknowns), by = spansOf(known, knowns);
  derivative(Way::forward, of, by, seed, change);
}

void Instance::derivative(Way way, const std::vector<Span>& unknowns, const std::vector<Span>& knowns,
                          const double seed[], double result[]) {
  for (const Span& s : unknowns) require(rangeOf(s.first), s.first, Causality::output);
  for (const Span& s : knowns) require(rangeOf(s.first), s.first, Causality::input);
  const bool forward = way == Way::forward;
  scratch.assign(simulation.layout().size, 0.0);
  for (const Span& s : forward ? knowns : unknowns) {
    for (std::size_t k = 0; k < s.count; ++k) {
      if (!std::isfinite(seed[k])) refuseValue(s.first, seed);
      scratch[s.place + k] += seed[k];
    }
    seed += s.count;
  }
  if (forward)
    simulation.directionalDerivative(scratch.data());
  else
    simulation.adjointDerivative(scratch.data());
  takeScratch(forward ? unknowns : knowns, result);
}

void Instance::setInputDerivatives(const std::uint32_t refs[], std::size_t count, const int orders[],
                                   const double values[]) {
  if (count > 0 && !refs) throw Refused("the array of value references is a null pointer");
  if (count > 0 && (!orders || !values)) throw Refused("an array of orders or values is a null pointer");
  // First all checks: a refused call changes nothing.
  for (std::size_t k = 0; k < count; ++k) {
    inputAt(refs[k]);
    if (orders[k] != 1 && orders[k] != 2)
      throw Refused("derivatives of inputs have order 1 or 2, not " + std::to_string(orders[k]));
    if (!std::isfinite(values[k])) refuseValue(refs[k], values + k);
  }
  for (std::size_t k = 0; k < count; ++k) simulation.setInputDerivative(inputAt(refs[k]), orders[k], values[k]);
}

void Instance::outputDerivatives(const std::uint32_t refs[], std::size_t count, const int orders[], double values[]) {
  if (count > 0 && (!orders || !values)) throw Refused("an array of orders or values is a null pointer");
  outputDerivatives(spansOf(refs, count), orders, count, values);
}

void Instance::outputDerivatives(const std::vector<Span>& outputs, const int orders[], std::size_t count,
                                 double values[]) {
  for (const Span& s : outputs) require(rangeOf(s.first), s.first, Causality::output);
  for (std::size_t k = 0; k < count; ++k)
    if (orders[k] != 1) throw Refused("derivatives of outputs have order 1, not " + std::to_string(orders[k]));
  if (count == 0) return;
  scratch.resize(simulation.layout().size);
  try {
    simulation.outputRates(scratch.data());
  } catch (const Diverged& e) {
    throw Refused(e.what());
  } catch (const StepTooLong& e) {
    throw Refused(e.what());
  }
  takeScratch(outputs, values);
}

}  // namespace tiefmu
