#include "array_access.hpp"

#include <algorithm>

namespace tiefmu {
namespace {

void requireSize(std::size_t given, std::size_t needed) {
  if (given != needed)
    throw Refused("the variables hold " + std::to_string(needed) + " values, not " + std::to_string(given));
}

void requireArrays(const void* references, std::size_t count, const void* values, std::size_t size) {
  if (count > 0 && !references) throw Refused("the array of value references is a null pointer");
  if (size > 0 && !values) throw Refused("the array of values is a null pointer");
}

}  // namespace

ArrayAccess::ArrayAccess(Instance& instance)
    : instance_(instance), arrays_(arraysOf(instance.model(), instance.blocks())) {
  std::size_t most = 0;
  for (const Array& a : arrays_.arrays) most += a.spans.size();
  for (auto* spans : {&spans_, &knownSpans_}) spans->reserve(most);
}

std::string ArrayAccess::nameOf(std::uint32_t r) const {
  if (r == Arrays::time) return "time";
  r -= 1;
  if (r < arrays_.arrays.size()) return arrays_.arrays[r].name;
  return arrays_.elements[r - arrays_.arrays.size()].name;
}

void ArrayAccess::requireKnown(std::uint32_t r) const {
  const std::size_t last = arrays_.arrays.size() + arrays_.elements.size();
  if (r > last)
    throw Refused("unknown value reference " + std::to_string(r) + "; the last one is " + std::to_string(last));
}

const Array& ArrayAccess::arrayOf(std::uint32_t r) const {
  requireKnown(r);
  if (r == Arrays::time) throw Refused("variable 'time' is the independent variable");
  if (r > arrays_.arrays.size()) throw Refused("variable '" + nameOf(r) + "' is not of type Float64");
  return arrays_.arrays[r - 1];
}

const Elements& ArrayAccess::elementsOf(std::uint32_t r, bool labels) const {
  requireKnown(r);
  const std::size_t n = arrays_.arrays.size();
  if (r <= n || arrays_.elements[r - n - 1].labels.empty() == labels)
    throw Refused("variable '" + nameOf(r) + "' is not of type " + (labels ? "String" : "Int64"));
  return arrays_.elements[r - n - 1];
}

void ArrayAccess::spansOf(const std::uint32_t refs[], std::size_t count, std::size_t size, std::vector<Span>& spans) {
  spans.clear();
  std::size_t needed = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Array& array = arrayOf(refs[i]);
    spans.insert(spans.end(), array.spans.begin(), array.spans.end());
    needed += array.count();
  }
  requireSize(size, needed);
}

void ArrayAccess::get(const std::uint32_t refs[], std::size_t count, double values[], std::size_t size) {
  requireArrays(refs, count, values, size);
  if (count == 1 && refs[0] == Arrays::time) {
    requireSize(size, 1);
    values[0] = instance_.time();
    return;
  }
  const std::uint32_t* const time = std::find(refs, refs + count, Arrays::time);
  if (time == refs + count) {
    spansOf(refs, count, size, spans_);
    return instance_.get(spans_, values);
  }
  std::size_t before = 0;
  for (const std::uint32_t* r = refs; r < time; ++r) before += arrayOf(*r).count();
  if (size < before + 1) requireSize(size, before + 1);
  const auto first = static_cast<std::size_t>(time - refs);
  if (first > 0) get(refs, first, values, before);
  values[before] = instance_.time();
  get(time + 1, count - first - 1, values + before + 1, size - before - 1);
}

void ArrayAccess::set(const std::uint32_t refs[], std::size_t count, const double values[], std::size_t size) {
  requireArrays(refs, count, values, size);
  spansOf(refs, count, size, spans_);
  instance_.set(spans_, values);
}

void ArrayAccess::getIds(const std::uint32_t refs[], std::size_t count, std::int64_t values[], std::size_t size) const {
  requireArrays(refs, count, values, size);
  std::size_t needed = 0;
  for (std::size_t i = 0; i < count; ++i) needed += elementsOf(refs[i], false).ids.size();
  requireSize(size, needed);
  for (std::size_t i = 0; i < count; ++i) {
    const Elements& e = elementsOf(refs[i], false);
    values = std::copy(e.ids.begin(), e.ids.end(), values);
  }
}

void ArrayAccess::getLabels(const std::uint32_t refs[], std::size_t count, const char* values[],
                            std::size_t size) const {
  requireArrays(refs, count, values, size);
  std::size_t needed = 0;
  for (std::size_t i = 0; i < count; ++i) needed += elementsOf(refs[i], true).labels.size();
  requireSize(size, needed);
  for (std::size_t i = 0; i < count; ++i)
    for (const std::string& label : elementsOf(refs[i], true).labels) *values++ = label.c_str();
}

void ArrayAccess::derivative(Way way, const std::uint32_t unknown[], std::size_t unknowns, const std::uint32_t known[],
                             std::size_t knowns, const double seed[], std::size_t seeds, double result[],
                             std::size_t results) {
  const bool forward = way == Way::forward;
  requireArrays(unknown, unknowns, forward ? result : seed, forward ? results : seeds);
  requireArrays(known, knowns, forward ? seed : result, forward ? seeds : results);
  spansOf(unknown, unknowns, forward ? results : seeds, spans_);
  spansOf(known, knowns, forward ? seeds : results, knownSpans_);
  instance_.derivative(way, spans_, knownSpans_, seed, result);
}

void ArrayAccess::outputDerivatives(const std::uint32_t refs[], std::size_t count, const int orders[], double values[],
                                    std::size_t size) {
  requireArrays(refs, count, values, size);
  if (count > 0 && !orders) throw Refused("the array of orders is a null pointer");
  spansOf(refs, count, size, spans_);
  instance_.outputDerivatives(spans_, orders, count, values);
}

std::vector<ArrayAccess::Entry> ArrayAccess::dependenciesOf(std::uint32_t reference) {
  const std::size_t n = arrays_.arrays.size();
  if (reference == Arrays::time || (reference > n && reference <= n + arrays_.elements.size())) return {};
  const Array& array = arrayOf(reference);
  if (array.causality == Causality::input || array.causality == Causality::parameter) return {};
  if (!dependencies_)
    dependencies_ = std::make_unique<const Dependencies>(dependencies(instance_.model(), instance_.blocks()));
  const bool initial = instance_.state == State::instantiated || instance_.state == State::initialization;
  const auto counts = [&](Causality c) { return c == Causality::input || (initial && c == Causality::parameter); };
  std::vector<Entry> entries;
  std::size_t element = 0;
  for (const Span& s : array.spans)
    for (std::uint32_t r = s.first; r < s.first + s.count; ++r) {
      ++element;
      if (dependencies_->all[r]) {
        for (const Array& known : arrays_.arrays)
          if (counts(known.causality)) entries.push_back({element, known.reference, 0, Dependence::dependent});
        continue;
      }
      for (std::size_t i = dependencies_->begin[r]; i < dependencies_->begin[r + 1]; ++i) {
        const Dependency& d = dependencies_->entries[i];
        const Arrays::Place place = arrays_.places[d.reference];
        const Array& known = arrays_.arrays[place.array];
        if (counts(known.causality)) entries.push_back({element, known.reference, place.element + 1, d.kind});
      }
    }
  return entries;
}

}  // namespace tiefmu
