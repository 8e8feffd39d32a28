// The FMU variables as FMI 3.0 has them: one array for all elements of a kind, and the ids of its elements beside it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "variables.hpp"

namespace tiefmu {

// Consecutive value references of FMI 2.0, and where they stand in Simulation::data(), consecutive too.
struct Span {
  std::uint32_t first;
  std::size_t count, place;
};

// Elements [n] or [n, 3] in the order of memory, C order; a scalar where it belongs to no node. Named like the scalars
// without their number: master.v. Where driven and free nodes have arrays of the same name, inputs and outputs, the
// free ones' is free_master.v; and slave_port.v where ports of both kinds do.
struct Array {
  std::string name;
  std::uint32_t reference;  // value reference of FMI 3.0, from 1: 0 is the time
  Causality causality;
  Field field;
  std::string_view unit, description;
  int components;  // 1 or 3
  bool scalar;
  std::vector<Span> spans;
  std::vector<std::int64_t> ids;    // node id per element; of ports their numbers
  std::vector<std::string> labels;  // of ports: their names
  std::size_t of;                   // index of its list in `Arrays::elements`; none for a scalar

  std::size_t count() const { return scalar ? 1 : ids.size() * static_cast<std::size_t>(components); }
};

// A constant array: which nodes (Int64) or ports (String) the elements of some arrays are, in their order. All masters,
// slaves, points and ports of the model are listed in master.node, slave.node, point.node and port.name; by ascending
// id nodes have the numbers that their scalars of FMI 2.0 are called by. An array of a part of them has a list of its
// own: master.t.node.
struct Elements {
  std::string name;
  std::uint32_t reference;
  std::vector<std::int64_t> ids;
  std::vector<std::string> labels;
};

struct Arrays {
  static constexpr std::uint32_t time = 0;  // its value reference
  std::vector<Array> arrays;                // value references 1, 2, ...
  std::vector<Elements> elements;           // value references after those
  // Of a scalar of FMI 2.0: its array and the element in it.
  struct Place {
    std::uint32_t array;  // index
    std::size_t element;  // in C order, from 0
  };
  std::vector<Place> places;  // by value reference of FMI 2.0
};

Arrays arraysOf(const Model& model, const std::vector<Block>& blocks);

}  // namespace tiefmu
