#include "host_step.hpp"

#include <vector>

#include "stability.hpp"

namespace tiefmu {

HostStep hostStep(const Simulation& simulation) {
  const Model& model = simulation.model();
  HostStep least;
  const auto consider = [&](double own, double added, double stiffness, int node, int port = -1) {
    if (!(own > 0) || !(stiffness > 0)) return;
    const double step = nodalStep(own + added, stiffness);
    if (step < least.step) least = {step, node, port};
  };
  std::vector<std::uint8_t> inPort(static_cast<std::size_t>(model.nodes()));
  for (std::size_t p = 0; p < model.drivenPorts(); ++p) {
    double own = 0, added = 0, stiffness = 0;
    for (int i : model.ports[p].member) {
      inPort[static_cast<std::size_t>(i)] = 1;
      own += model.nodeMass[i];
      added += simulation.field(Field::addedMass)[i];
      stiffness += simulation.field(Field::stiffness)[i];
    }
    consider(own, added, stiffness, 0, static_cast<int>(p));
  }
  for (int group : {rotatingDrivenMaster, drivenMaster})
    for (int i = model.begin[group]; i < model.begin[group + 1]; ++i) {
      if (inPort[static_cast<std::size_t>(i)]) continue;
      consider(model.nodeMass[i], simulation.field(Field::addedMass)[i], simulation.field(Field::stiffness)[i], i);
      if (i < model.rotating())
        consider(model.nodeInertia[i], simulation.field(Field::addedInertia)[i],
                 simulation.field(Field::rotationalStiffness)[i], i);
    }
  return least;
}

}  // namespace tiefmu
