// How inputs move inside a step: value + first tau + second tau^2 / 2, tau from the start of the step (s).
#pragma once

#include <cstddef>
#include <vector>

#include "layout.hpp"

namespace tiefmu {

struct InputDerivatives {
  std::size_t place;  // in the array
  double first, second;
};

class InputCurve {
 public:
  // Derivative of the given order (1 or 2) of the input at `place` of the array, for the next step only.
  void set(std::size_t place, int order, double value, const Layout& layout);
  bool active() const { return !entries_.empty(); }
  bool knows(std::size_t place) const { return active() && index_[place] > 0; }
  void clear();
  // What has been set, in that order, and the same put back.
  std::vector<InputDerivatives> all() const { return {entries_.begin(), entries_.end()}; }
  void assign(const std::vector<InputDerivatives>& derivatives, const Layout& layout);

  void begin(const double* data);           // tau = 0: the inputs as they stand
  void at(double tau, double* data) const;  // inputs at tau
  // The vector at `place`, at tau and its mean over [tau, tau + h], whatever `data` holds of what moves.
  Vec3 at(std::size_t place, double tau, const double* data) const;
  Vec3 mean(std::size_t place, double tau, double h, const double* data) const;
  void over(double tau, double h, double* data) const;  // velocities and spins at their mean over [tau, tau + h]

 private:
  struct Entry : InputDerivatives {
    bool motion;  // velocity or spin
    double base;
    double at(double tau) const { return base + tau * (first + 0.5 * tau * second); }
    double mean(double tau, double h) const {
      return base + (tau + 0.5 * h) * first + 0.5 * (tau * (tau + h) + h * h / 3) * second;
    }
  };
  std::vector<Entry> entries_;
  std::vector<int> index_;  // place -> entry + 1
};

}  // namespace tiefmu
