#include "input_curve.hpp"

namespace tiefmu {

void InputCurve::set(std::size_t place, int order, double value, const Layout& layout) {
  index_.resize(layout.size);
  int& index = index_[place];
  if (index == 0) {
    const auto in = [&](Field f) { return place >= layout[f].offset && place < layout[f].offset + layout[f].count; };
    entries_.push_back({{place, 0, 0}, in(Field::velocity) || in(Field::spin), 0});
    index = static_cast<int>(entries_.size());
  }
  (order == 1 ? entries_[index - 1].first : entries_[index - 1].second) = value;
}

void InputCurve::clear() {
  for (const Entry& e : entries_) index_[e.place] = 0;
  entries_.clear();
}

void InputCurve::assign(const std::vector<InputDerivatives>& derivatives, const Layout& layout) {
  clear();
  for (const InputDerivatives& d : derivatives) {
    set(d.place, 1, d.first, layout);
    set(d.place, 2, d.second, layout);
  }
}

void InputCurve::begin(const double* data) {
  for (Entry& e : entries_) e.base = data[e.place];
}

void InputCurve::at(double tau, double* data) const {
  for (const Entry& e : entries_) data[e.place] = e.base + tau * (e.first + 0.5 * tau * e.second);
}

void InputCurve::over(double tau, double h, double* data) const {
  for (const Entry& e : entries_)
    if (e.motion) data[e.place] = e.base + (tau + 0.5 * h) * e.first + 0.5 * (tau * (tau + h) + h * h / 3) * e.second;
}

}  // namespace tiefmu
