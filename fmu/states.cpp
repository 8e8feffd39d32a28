// Saving, restoring and serialising an instance's state.
#include "instance.hpp"

namespace tiefmu {

SavedState& Instance::known(void* saved) const {
  const auto found = savedStates.find(saved);
  if (found == savedStates.end()) throw Refused("this is no state that the instance has saved");
  return *found->second;
}

void Instance::keep(void** saved, std::unique_ptr<SavedState> fresh) {
  void* const handle = fresh.get();
  savedStates.emplace(handle, std::move(fresh));
  *saved = handle;
}

void Instance::getState(void** saved) {
  if (!saved) throw Refused("the place for the state is a null pointer");
  if (!*saved) keep(saved, std::make_unique<SavedState>());
  SavedState& s = known(*saved);
  simulation.save(s.simulation);
  s.state = state;
  s.clock = clock;
}

void Instance::setState(void* saved) {
  const SavedState& s = known(saved);
  simulation.restore(s.simulation);
  state = s.state;
  clock = s.clock;
  host = hostStep(simulation);
}

void Instance::freeState(void** saved) {
  if (!saved || !*saved) return;
  known(*saved);
  savedStates.erase(*saved);
  *saved = nullptr;
}

std::size_t Instance::serializedStateSize(void* saved) const { return serializedSize(known(saved), guid); }

void Instance::serializeState(void* saved, char bytes[], std::size_t size) const {
  const SavedState& s = known(saved);
  const std::size_t needed = serializedSize(s, guid);
  if (!bytes) throw Refused("the place for the bytes is a null pointer");
  if (size < needed)
    throw Refused("the state takes " + std::to_string(needed) + " bytes, there is room for " + std::to_string(size));
  serialize(s, guid, bytes, needed);
}

void Instance::deserializeState(const char bytes[], std::size_t size, void** saved) {
  if (!bytes) throw Refused("the array of bytes is a null pointer");
  if (!saved) throw Refused("the place for the state is a null pointer");
  auto fresh = std::make_unique<SavedState>();
  try {
    *fresh = deserialize({bytes, size}, guid, simulation.layout().size);
  } catch (const StateError& e) {
    throw Refused(e.what());
  }
  for (const InputDerivatives& d : fresh->simulation.inputs) {
    bool input = false;
    for (const Range& r : ranges)
      input |= r.causality == Causality::input && d.place >= r.place && d.place - r.place < r.end - r.first;
    if (!input) throw Refused("the state contradicts itself");
  }
  if (const auto found = savedStates.find(*saved); found != savedStates.end())
    *found->second = std::move(*fresh);
  else
    keep(saved, std::move(fresh));
}

}  // namespace tiefmu
