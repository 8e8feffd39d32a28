// How inputs move inside a step: value + first tau + second tau^2 / 2, tau from the start of the step (s).
#pragma once

#include <cstddef>
#include <vector>

#include "layout.hpp"

namespace tiefmu {

class InputCurve {
 public:
  // Derivative of the given order (1 or 2) of the input at `place` of the array, for the next step only.
  void set(std::size_t place, int order, double value, const Layout& layout);
  bool active() const { return !entries_.empty(); }
  void clear();

  void begin(const double* data);                          // tau = 0: the inputs as they stand
  void at(double tau, double* data) const;                 // inputs at tau
  void over(double tau, double h, double* data) const;     // velocities and spins at their mean over [tau, tau + h]

 private:
  struct Entry {
    std::size_t place;
    bool motion;  // velocity or spin
    double base, first, second;
  };
  std::vector<Entry> entries_;
  std::vector<int> index_;  // place -> entry + 1
};

}  // namespace tiefmu
