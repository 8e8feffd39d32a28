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

void Instance::requireOutputs(const std::uint32_t refs[], std::size_t count) const {
  forRuns(refs, count, [&](const Range& range, std::uint32_t first, std::size_t, std::size_t) {
    require(range, first, Causality::output);
  });
}

void Instance::takeScratch(const std::uint32_t refs[], std::size_t count, double values[]) const {
  forRuns(refs, count, [&](const Range& range, std::uint32_t first, std::size_t run, std::size_t i) {
    std::copy_n(scratch.begin() + static_cast<std::ptrdiff_t>(range.place + (first - range.first)), run, values + i);
  });
}

void Instance::directionalDerivative(const std::uint32_t unknown[], std::size_t unknowns, const std::uint32_t known[],
                                     std::size_t knowns, const double seed[], double change[]) {
  if (knowns > 0 && !known) throw Refused("the array of value references is a null pointer");
  if ((unknowns > 0 && !change) || (knowns > 0 && !seed)) throw Refused("an array of values is a null pointer");
  requireOutputs(unknown, unknowns);
  scratch.assign(simulation.layout().size, 0.0);
  for (std::size_t k = 0; k < knowns; ++k) {
    const std::size_t place = inputAt(known[k]);
    if (!std::isfinite(seed[k])) refuseValue(known[k], seed + k);
    scratch[place] += seed[k];
  }
  simulation.directionalDerivative(scratch.data());
  takeScratch(unknown, unknowns, change);
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
  for (const Span& s : forward ? unknowns : knowns)
    result = std::copy_n(scratch.begin() + static_cast<std::ptrdiff_t>(s.place), s.count, result);
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
  requireOutputs(refs, count);
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
  takeScratch(refs, count, values);
}

}  // namespace tiefmu
