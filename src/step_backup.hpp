// What a step changes and cannot compute anew, kept so that a step that fails leaves no trace.
#pragma once

#include <array>
#include <vector>

#include "dynamics.hpp"

namespace tiefmu {

class StepBackup {
 public:
  explicit StepBackup(Dynamics& dynamics);

  void save();     // no allocation
  void restore();  // also the inputs that move inside the step, as they stood at its start

 private:
  Dynamics& d_;
  std::array<Slice, 2> kept_{};
  std::vector<double> values_;
};

}  // namespace tiefmu
