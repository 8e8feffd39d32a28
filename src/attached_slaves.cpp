#include "attached_slaves.hpp"

#include <algorithm>

namespace tiefmu {

AttachedSlaves::AttachedSlaves(const Model& model, Ties& ties) : model_(model), ties_(ties) {
  std::vector<std::uint8_t> attached(model.slaves(), 0);
  for (const Spring& spring : model.springs)
    for (const SpringEnd* end : {&spring.a, &spring.b})
      if (end->slave >= 0) attached[end->slave] = 1;
  for (const Port& port : model.ports)
    if (port.ofSlaves)
      for (int slave : port.member) attached[slave] = 1;
  for (std::size_t g = 0; g < model.groups.size(); ++g) {
    const TieGroup& group = model.groups[g];
    for (int e = 0; e < group.segments(); ++e) {
      const auto* first = attached.data() + group.firstSlave;
      if (std::none_of(first + group.begin[e], first + group.begin[e + 1], [](auto a) { return a; })) continue;
      if (!runs_.empty() && runs_.back().group == g && runs_.back().range.last == e)
        ++runs_.back().range.last;
      else
        runs_.push_back({g, {e, e + 1}});
    }
  }
  if (model.springs.empty() && model.drivenPorts() == model.ports.size()) return;
  xs_.resize(3 * static_cast<std::size_t>(model.slaves()));
  vs_.resize(xs_.size());
  ws_.resize(3 * static_cast<std::size_t>(model.turning()));
}

void AttachedSlaves::updatePositions() {
  ties_.beginPlacing();
  for (const Run& run : runs_) ties_.placeSlaves(run.group, run.range, xs_.data());
}

void AttachedSlaves::updateMotion(const double* v, const double* w) {
  for (const Run& run : runs_)
    mapMotion(model_.groups[run.group], run.range, ties_.geometry(run.group), v, w, vs_.data(), ws_.data());
}

void AttachedSlaves::distributeLoads(const double* force, const double* moment, double* f, double* t) const {
  for (const Run& run : runs_)
    tiefmu::distributeLoads(model_.groups[run.group], run.range, ties_.geometry(run.group), force, moment, f, t);
}

}  // namespace tiefmu
