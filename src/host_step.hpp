// How long a step an explicit host may take with the driven masters that it moves.
#pragma once

#include <limits>

#include "simulation.hpp"

namespace tiefmu {

// Theory (6.3) for what the host moves: it carries its declared mass and the lumped addition (theory 5), on the
// declared stiffness and the slaves'. Where no mass is declared nothing is known.
struct HostStep {
  double step = std::numeric_limits<double>::infinity();  // s
  int node = 0, port = -1;                                // whose it is: a port's, else the node's
};

// Of an initialised simulation.
HostStep hostStep(const Simulation& simulation);

}  // namespace tiefmu
