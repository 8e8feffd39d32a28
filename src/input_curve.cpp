#include "input_curve.hpp"

namespace tiefmu {

void InputCurve::set(std::size_t place, int order, double value, const Layout& layout) {
  index_.resize(layout.size);
  int& index = index_[place];
  if (index == 0) {
    const auto in = [&](Field f) { return layout[f].holds(place); };
    entries_.push_back(
        {{place, 0, 0}, in(Field::velocity) || in(Field::spin) || in(Field::portVelocity) || in(Field::portSpin), 0});
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
  for (const Entry& e : entries_) data[e.place] = e.at(tau);
}

void InputCurve::over(double tau, double h, double* data) const {
  for (const Entry& e : entries_)
    if (e.motion) data[e.place] = e.mean(tau, h);
}

Vec3 InputCurve::at(std::size_t place, double tau, const double* data) const {
  Vec3 value;
  for (std::size_t k = 0; k < 3; ++k)
    value[k] = knows(place + k) ? entries_[index_[place + k] - 1].at(tau) : data[place + k];
  return value;
}

Vec3 InputCurve::mean(std::size_t place, double tau, double h, const double* data) const {
  Vec3 value;
  for (std::size_t k = 0; k < 3; ++k)
    value[k] = knows(place + k) ? entries_[index_[place + k] - 1].mean(tau, h) : data[place + k];
  return value;
}

}  // namespace tiefmu
