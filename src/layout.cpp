#include "layout.hpp"

#include <algorithm>

#include "inertia.hpp"
#include "inertia_islands.hpp"

namespace tiefmu {
namespace {

bool anySpring(const Model& model, auto predicate) {
  return std::any_of(model.springs.begin(), model.springs.end(), predicate);
}

std::size_t frames(const Model& model) {
  std::size_t count = 0;
  for (const TieGroup& group : model.groups)
    if (kinematicsOf(group.coupling).segmentsTurn) count += static_cast<std::size_t>(group.segments());
  return count;
}

bool framesTurn(const Model& model) {
  bool offsets = false;
  for (const TieGroup& group : model.groups)
    if (kinematicsOf(group.coupling).segmentsTurn)
      for (int k = 3 * group.firstSlave; k < 3 * (group.firstSlave + group.slaves()); ++k)
        offsets |= model.slaveOffset[k] != 0;
  const auto ofFrame = [last = static_cast<int>(frames(model))](const SpringEnd& end) {
    return end.orientation >= 0 && end.orientation < last;
  };
  return (model.finite() && offsets) ||
         anySpring(model, [&](const Spring& spring) { return ofFrame(spring.a) || ofFrame(spring.b); });
}

bool isPresent(const FieldRow& row, const Model& model) {
  switch (row.when) {
    case When::always: return true;
    case When::free: return model.anyFree();
    case When::accelerationInputs: return model.accelerationInputs();
    case When::accelerations:
      return model.anyFree() || model.accelerationInputs() || model.exposes(rowOf(Field::slaveAcceleration).exposedAs);
    case When::positions: return model.needsPositions();
    case When::framesTurn: return framesTurn(model);
    case When::anglesAdd:
      return !model.finite() && model.needsPositions() &&
             std::any_of(model.groups.begin(), model.groups.end(),
                         [](const TieGroup& group) { return kinematicsOf(group.coupling).mastersTurn; });
    case When::finite: return model.finite();
    case When::led: return model.settings.reactionLead > 0;
    case When::damped:
      return model.anyFree() && anySpring(model, [](const Spring& spring) {
               return !spring.damping.isZero(0) || !spring.rotationalDamping.isZero(0);
             });
    case When::biased:
      return model.anyFree() && model.settings.inertia == Inertia::consistent && model.finite() && model.turning() > 0;
    case When::iterated:
      return model.anyFree() && model.settings.inertia == Inertia::consistent &&
             ConsistentInertia::iterates(model, SegmentsAlone(model).rest);
    case When::modeKept: return model.anyFree() && model.finite() && !model.springs.empty();
    case When::exposed: return model.exposes(row.exposedAs);
  }
  return false;
}

std::size_t rows(Per per, const Model& model) {
  const std::size_t nodes = model.nodes(), rotating = model.rotating();
  switch (per) {
    case Per::simulation: return 1;
    case Per::node: return nodes;
    case Per::rotatingNode: return rotating;
    case Per::nodeThenRotatingNode: return nodes + rotating;
    case Per::freeNodeThenRotatingNode:
      return static_cast<std::size_t>(model.free() + model.rotating() - model.freeBegin());
    case Per::slave: return static_cast<std::size_t>(model.slaves());
    case Per::turningSlave: return static_cast<std::size_t>(model.turning());
    case Per::drivenPort: return model.drivenPorts();
    case Per::slavePort: return model.ports.size() - model.drivenPorts();
    case Per::port: return model.ports.size();
    case Per::frame: return frames(model);
    case Per::orientedEnd: return model.oriented.size();
  }
  return 0;
}

}  // namespace

Layout::Layout(const Model& model) {
  for (const FieldRow& row : fieldRows) {
    const std::size_t count =
        isPresent(row, model) ? static_cast<std::size_t>(row.components) * rows(row.per, model) : 0;
    slices[indexOf(row.field)] = {size, count};
    size += count;
  }
}

}  // namespace tiefmu
