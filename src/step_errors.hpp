// How a step fails. The state before it has been put back when one of these is thrown.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace tiefmu {

// A non-finite or runaway number, that at `place` of the array if it is one.
struct Diverged : std::runtime_error {
  explicit Diverged(const std::string& message, std::size_t where = nowhere)
      : std::runtime_error(message), place(where) {}
  static constexpr std::size_t nowhere = ~std::size_t{0};
  std::size_t place;
};

// More than a thousand million substeps.
struct StepTooLong : std::runtime_error { using std::runtime_error::runtime_error; };

}  // namespace tiefmu
