// The variables of an instance as arrays of FMI 3.0.
#pragma once

#include <memory>
#include <vector>

#include "../modelDescription/arrays.hpp"
#include "../modelDescription/dependencies.hpp"
#include "instance.hpp"

namespace tiefmu {

class ArrayAccess {
 public:
  explicit ArrayAccess(Instance& instance);

  // `count` arrays, whose values follow each other and must be `size` together. All throw Refused.
  void get(const std::uint32_t references[], std::size_t count, double values[], std::size_t size);
  void set(const std::uint32_t references[], std::size_t count, const double values[], std::size_t size);
  void getIds(const std::uint32_t references[], std::size_t count, std::int64_t values[], std::size_t size) const;
  void getLabels(const std::uint32_t references[], std::size_t count, const char* values[], std::size_t size) const;
  // Forward: of the unknowns along a seed of the knowns. Transposed: of the knowns by a seed of the unknowns.
  void derivative(Way way, const std::uint32_t unknown[], std::size_t unknowns, const std::uint32_t known[],
                  std::size_t knowns, const double seed[], std::size_t seeds, double result[], std::size_t results);
  void outputDerivatives(const std::uint32_t references[], std::size_t count, const int orders[], double values[],
                         std::size_t size);

  // An element depends on one of another array; elements count from 1 in C order, 0: all.
  struct Entry {
    std::size_t dependent;
    std::uint32_t array;  // value reference
    std::size_t independent;
    Dependence kind;
  };
  std::vector<Entry> dependenciesOf(std::uint32_t reference);

 private:
  void requireKnown(std::uint32_t reference) const;
  const Array& arrayOf(std::uint32_t reference) const;
  const Elements& elementsOf(std::uint32_t reference, bool labels) const;
  void spansOf(const std::uint32_t references[], std::size_t count, std::size_t size, std::vector<Span>& spans);
  std::string nameOf(std::uint32_t reference) const;

  Instance& instance_;
  const Arrays arrays_;
  std::vector<Span> spans_, knownSpans_;  // of the present call
  std::unique_ptr<const Dependencies> dependencies_;
};

}  // namespace tiefmu
