#include "model.hpp"

#include <algorithm>

namespace tiefmu {

bool Model::anyDriven() const {
  for (int g : {rotatingDrivenMaster, rotatingDrivenPoint, drivenMaster, drivenPoint})
    if (begin[g + 1] > begin[g]) return true;
  return false;
}

bool Model::shareable() const {
  return std::any_of(groups.begin(), groups.end(), [](const TieGroup& g) { return g.partEnd.size() > 1; });
}

std::size_t Model::drivenPorts() const {
  return static_cast<std::size_t>(std::count_if(ports.begin(), ports.end(), [](const Port& p) { return !p.ofSlaves; }));
}

bool Model::exposes(const char* name) const {
  return std::find(settings.expose.begin(), settings.expose.end(), name) != settings.expose.end();
}

bool Model::needsPositions() const {
  if (!springs.empty() || exposes("slave.r") || exposes("master.r") || exposes("point.r") || exposes("port.r"))
    return true;
  if (settings.position == Position::input && anyDriven()) return true;
  if (!finite()) return false;
  for (const Port& port : ports)
    if (port.ofSlaves && port.member.size() > 1) return true;
  return std::any_of(groups.begin(), groups.end(),
                     [](const TieGroup& g) { return kinematicsOf(g.coupling).segmentsTurn; });
}

}  // namespace tiefmu
