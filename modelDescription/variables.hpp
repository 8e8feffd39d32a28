// The FMU variables of a model.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "../src/simulation.hpp"
#include "table.hpp"

namespace tiefmu {

// A block: `numbers.size()` elements of `components` doubles each, contiguous in memory and in value references.
// Variable k of element e is named prefix[numbers[e]].name[k+1] (components 3), prefix[numbers[e]].name (1), or just
// `name` where prefix is empty. Ports have names in place of numbers: port[labels[e]].name[k+1]. Flat names are the
// same with _ for dots, opening brackets and what else no identifier holds, and without closing brackets: master_1_v_3.
// Its value reference is reference + e * components + k, its place in Simulation::data() is place + e * components + k.
struct Block {
  std::string_view prefix;  // "master", "slave", "point", "port" or ""
  std::string_view name;    // "v", "f_ext", "stable_time_step", ...
  int components;           // 1 or 3
  Causality causality;
  std::string_view unit;         // e.g. "m/s"
  std::string_view description;  // without the id; "(node ID)" or "(port NAME)" is appended per element
  DependsOn dependsOn;
  Field field;
  std::size_t place;
  std::vector<int> numbers;
  std::vector<std::int64_t> ids;    // node id per element; of ports their numbers
  std::vector<std::string> labels;  // of ports: their names
  Names names{};
  std::uint32_t reference = 0;
  std::size_t count() const { return numbers.size() * static_cast<std::size_t>(components); }
};

// Blocks in the order of their value references (from 0, without gaps), which is the order of Simulation::data().
std::vector<Block> variables(const Model& model, const Layout& layout);

// Name of variable `component` (from 0) of element `element`: "master[1].v[3]".
std::string variableName(const Block& block, std::size_t element, int component);

// Throws SceneError ("interface: expose: unknown name 'x'; known: ...") unless every name of settings.expose and
// settings.hide is one of table.hpp, and where flat names of two ports are the same.
void checkInterface(const Scene& scene);

}  // namespace tiefmu
