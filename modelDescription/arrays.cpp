#include "arrays.hpp"

#include <algorithm>
#include <utility>

namespace tiefmu {
namespace {

bool ofSlavePorts(Field f) {
  return f == Field::portMeanVelocity || f == Field::portMeanSpin || f == Field::portForce || f == Field::portMoment;
}

// Of everything that has variables.
std::vector<Elements> wholeLists(const Model& model, const std::vector<Block>& blocks) {
  std::vector<std::int64_t> masters, points;
  for (int group = 0; group < nodeGroups; ++group)
    for (int node = model.begin[group]; node < model.begin[group + 1]; ++node)
      (model.isMaster(group) ? masters : points).push_back(model.nodeId[node]);
  std::vector<std::string> ports;
  for (const Port& port : model.ports) ports.push_back(port.name);
  std::vector<Elements> lists = {{"master.node", 0, std::move(masters), {}},
                                 {"slave.node", 0, model.slaveId, {}},
                                 {"point.node", 0, std::move(points), {}},
                                 {"port.name", 0, {}, std::move(ports)}};
  std::erase_if(lists, [&](const Elements& e) {
    return std::none_of(blocks.begin(), blocks.end(),
                        [&](const Block& b) { return !b.prefix.empty() && e.name.starts_with(b.prefix); });
  });
  return lists;
}

// The list that names the elements of `array`: the whole one of its prefix, or a new one.
std::size_t listOf(std::vector<Elements>& lists, const Array& array, std::string_view prefix) {
  const bool named = !array.labels.empty();
  const auto whole =
      std::find_if(lists.begin(), lists.end(), [&](const Elements& e) { return e.name.starts_with(prefix); });
  if (named ? whole->labels == array.labels : whole->ids == array.ids)
    return static_cast<std::size_t>(whole - lists.begin());
  lists.push_back(
      {array.name + (named ? ".name" : ".node"), 0, named ? std::vector<std::int64_t>{} : array.ids, array.labels});
  return lists.size() - 1;
}

}  // namespace

Arrays arraysOf(const Model& model, const std::vector<Block>& blocks) {
  Arrays all;
  all.elements = wholeLists(model, blocks);
  std::vector<std::string_view> prefixes;
  for (const Block& b : blocks) {
    const bool scalar = b.prefix.empty();
    const std::string name = scalar ? std::string(b.name) : std::string(b.prefix) + "." + std::string(b.name);
    auto array = std::find_if(all.arrays.begin(), all.arrays.end(),
                              [&](const Array& a) { return a.name == name && a.causality == b.causality; });
    if (array == all.arrays.end()) {
      const auto reference = static_cast<std::uint32_t>(all.arrays.size() + 1);
      all.arrays.push_back(
          {name, reference, b.causality, b.field, b.unit, b.description, b.components, scalar, {}, {}, {}, 0});
      prefixes.push_back(b.prefix);
      array = all.arrays.end() - 1;
    }
    const std::size_t before = array->ids.size() * static_cast<std::size_t>(b.components);
    const auto index = static_cast<std::uint32_t>(array - all.arrays.begin());
    array->spans.push_back({b.reference, b.count(), b.place});
    array->ids.insert(array->ids.end(), b.ids.begin(), b.ids.end());
    array->labels.insert(array->labels.end(), b.labels.begin(), b.labels.end());
    for (std::size_t k = 0; k < b.count(); ++k) all.places.push_back({index, before + k});
  }
  for (Array& array : all.arrays) {
    const auto twin = [&](const Array& other) { return other.name == array.name && &other != &array; };
    if (std::none_of(all.arrays.begin(), all.arrays.end(), twin)) continue;
    if (ofSlavePorts(array.field)) array.name.insert(0, "slave_");
    if (array.labels.empty() && array.causality == Causality::output) array.name.insert(0, "free_");
  }
  for (std::size_t i = 0; i < all.arrays.size(); ++i) {
    Array& array = all.arrays[i];
    if (array.scalar) continue;
    array.of = listOf(all.elements, array, prefixes[i]);
  }
  auto next = static_cast<std::uint32_t>(all.arrays.size() + 1);
  for (Elements& e : all.elements) e.reference = next++;
  return all;
}

}  // namespace tiefmu
