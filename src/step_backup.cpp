#include "step_backup.hpp"

#include <algorithm>

namespace tiefmu {

// Two slices of the array, without offsets where these follow from the segments' rotations.
StepBackup::StepBackup(Dynamics& dynamics) : d_(dynamics) {
  const Model& model = d_.model;
  const Layout& layout = d_.layout;
  const auto any = [&](auto has) {
    return std::any_of(model.groups.begin(), model.groups.end(),
                       [&](const TieGroup& g) { return has(kinematicsOf(g.coupling)); });
  };
  const bool offsets = any([](Kinematics k) { return k.slavesTurn && !k.segmentsTurn; });
  if (model.anyFree()) {
    static_assert(allAre(Field::velocity, Field::position, Role::motion));
    static_assert(adjacent(Field::position, Field::offset) && adjacent(Field::offset, Field::segmentRotation));
    static_assert(allAre(Field::offset, Field::integratorLimit, Role::state));
    kept_ = {layout.through(Field::velocity, Field::position),
             layout.through(offsets ? Field::offset : Field::segmentRotation, Field::integratorLimit)};
  } else if (any([](Kinematics k) { return k.segmentsTurn; }) && model.finite()) {
    // An all-driven scene loses what it cannot compute anew only where a segment collapses.
    static_assert(allAre(Field::segmentRotation, Field::work, Role::state));
    kept_ = {layout.through(Field::position, offsets ? Field::offset : Field::position),
             layout.through(Field::segmentRotation, Field::work)};
  }
  values_.resize(kept_[0].count + kept_[1].count);
}

void StepBackup::save() {
  double* to = values_.data();
  for (const Slice& slice : kept_) {
    const double* from = d_.data + slice.offset;
    d_.ties.eachBlock(slice.count,
                      [&](std::size_t first, std::size_t last) { std::copy(from + first, from + last, to + first); });
    to += slice.count;
  }
}

void StepBackup::restore() {
  d_.inputs.at(0, d_.data);
  const double* from = values_.data();
  for (const Slice& slice : kept_) {
    std::copy_n(from, slice.count, d_.data + slice.offset);
    from += slice.count;
  }
}

}  // namespace tiefmu
