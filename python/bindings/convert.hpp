// NumPy arrays in and out of the solver's vectors. What the module gives are copies.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <vector>

#include "../../src/scene.hpp"

namespace tiefmu {

namespace nb = nanobind;

using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;  // of any shape
using Indices = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <class T> using Array = nb::ndarray<nb::numpy, T>;

// A NumPy array of `shape` that owns `values`.
template <class T> Array<T> numpy(std::vector<T> values, std::initializer_list<std::size_t> shape) {
  auto* owned = new std::vector<T>(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return Array<T>(owned->data(), shape, owner);
}
template <class T> Array<T> numpy(std::vector<T> values) {
  const std::size_t n = values.size();
  return numpy(std::move(values), {n});
}

inline void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);  // ValueError
}

// The value of an enumeration that scene files call `word`.
template <class E> E fromWord(const std::string& word) {
  const auto found = std::find(words<E>.begin(), words<E>.end(), word);
  std::string known;
  for (const char* each : words<E>) known.append(known.empty() ? "'" : ", '").append(each).append("'");
  require(found != words<E>.end(), "'" + word + "' is not one of " + known);
  return static_cast<E>(found - words<E>.begin());
}

}  // namespace tiefmu
