// Where every number of a simulation stands.
#pragma once

#include <array>
#include <cstddef>

#include "fields.hpp"
#include "model.hpp"

namespace tiefmu {

struct Slice {
  std::size_t offset = 0, count = 0;  // in doubles; count 0: this model has no such field
  std::size_t end() const { return offset + count; }
  bool holds(std::size_t place) const { return place >= offset && place < end(); }
};

// Where each field of a model stands in the array.
struct Layout {
  explicit Layout(const Model& model);
  Slice operator[](Field f) const { return slices[indexOf(f)]; }
  // From the first through the last of fields that are copied as one.
  Slice through(Field first, Field last) const {
    return {(*this)[first].offset, (*this)[last].end() - (*this)[first].offset};
  }
  std::size_t size = 0;
  std::array<Slice, fieldCount> slices{};
};

}  // namespace tiefmu
