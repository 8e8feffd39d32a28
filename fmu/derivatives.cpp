// Derivatives of outputs with respect to inputs, and of inputs and outputs with respect to time.
#include <algorithm>
#include <cmath>

#include "instance.hpp"

namespace tiefmu {

std::size_t Instance::placeOf(std::uint32_t reference, Causality causality) const {
  const Range& range = rangeOf(reference);
  if (range.causality != causality)
    throw Refused("variable '" + nameOf(reference) + "' is not an " +
                  (causality == Causality::input ? "input" : "output"));
  return range.place + (reference - range.first);
}

void Instance::directionalDerivative(const fmi2ValueReference unknown[], std::size_t unknowns,
                                     const fmi2ValueReference known[], std::size_t knowns, const double seed[],
                                     double change[]) {
  if ((unknowns > 0 && !unknown) || (knowns > 0 && !known))
    throw Refused("an array of value references is a null pointer");
  if ((unknowns > 0 && !change) || (knowns > 0 && !seed)) throw Refused("an array of values is a null pointer");
  for (std::size_t k = 0; k < unknowns; ++k) placeOf(unknown[k], Causality::output);
  scratch.assign(simulation.layout().size, 0.0);
  for (std::size_t k = 0; k < knowns; ++k) {
    const std::size_t place = placeOf(known[k], Causality::input);
    if (!std::isfinite(seed[k])) refuseValue(known[k], seed + k);
    scratch[place] += seed[k];
  }
  simulation.directional(scratch.data());
  for (std::size_t k = 0; k < unknowns; ++k) change[k] = scratch[placeOf(unknown[k], Causality::output)];
}

void Instance::setInputDerivatives(const fmi2ValueReference refs[], std::size_t count, const fmi2Integer orders[],
                                   const double values[]) {
  if (count > 0 && !refs) throw Refused("the array of value references is a null pointer");
  if (count > 0 && (!orders || !values)) throw Refused("an array of orders or values is a null pointer");
  // First all checks: a refused call changes nothing.
  for (std::size_t k = 0; k < count; ++k) {
    placeOf(refs[k], Causality::input);
    if (orders[k] != 1 && orders[k] != 2)
      throw Refused("derivatives of inputs have order 1 or 2, not " + std::to_string(orders[k]));
    if (!std::isfinite(values[k])) refuseValue(refs[k], values + k);
  }
  for (std::size_t k = 0; k < count; ++k)
    simulation.setInputDerivative(placeOf(refs[k], Causality::input), orders[k], values[k]);
}

void Instance::outputDerivatives(const fmi2ValueReference refs[], std::size_t count, const fmi2Integer orders[],
                                 double values[]) {
  if (count > 0 && !refs) throw Refused("the array of value references is a null pointer");
  if (count > 0 && (!orders || !values)) throw Refused("an array of orders or values is a null pointer");
  for (std::size_t k = 0; k < count; ++k) {
    placeOf(refs[k], Causality::output);
    if (orders[k] != 1)
      throw Refused("derivatives of outputs have order 1, not " + std::to_string(orders[k]));
  }
  if (count == 0) return;
  scratch.resize(simulation.layout().size);
  try {
    simulation.outputRates(scratch.data());
  } catch (const Diverged& e) {
    throw Refused(e.what());
  } catch (const StepTooLong& e) {
    throw Refused(e.what());
  }
  for (std::size_t k = 0; k < count; ++k) values[k] = scratch[placeOf(refs[k], Causality::output)];
}

}  // namespace tiefmu
