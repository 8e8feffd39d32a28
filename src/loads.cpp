#include "loads.hpp"

#include <algorithm>

namespace tiefmu {

Loads::Loads(const Model& model, const Layout& layout, const double* data, AttachedSlaves& slaves,
             SpringNetwork& springs, Ports& ports)
    : model_(model),
      layout_(layout),
      data_(data),
      slaves_(slaves),
      springs_(springs),
      ports_(ports),
      gravity_(!model.settings.gravity.isZero(0)) {
  if (!springs.empty() || gravity_ || ports.anyOfSlaves()) {
    fs_.resize(3 * static_cast<std::size_t>(model.slaves()));
    ms_.resize(3 * static_cast<std::size_t>(model.turning()));
  }
  if (!springs.empty() || gravity_ || layout[Field::energy].count > 0) {
    f_.resize(3 * static_cast<std::size_t>(model.nodes()));
    t_.resize(3 * static_cast<std::size_t>(model.rotating()));
  }
}

void Loads::gather(const double* v, const double* w) {
  slaveForce_ = field(Field::slaveForce);
  slaveMoment_ = field(Field::slaveMoment);
  nodeForce_ = field(Field::nodeForce);
  nodeMoment_ = field(Field::nodeMoment);
  springs_.clear();
  if (!f_.empty()) {
    std::fill(f_.begin(), f_.end(), 0.0);
    std::fill(t_.begin(), t_.end(), 0.0);
    const Vec3& g = model_.settings.gravity;
    for (int i = model_.freeBegin(); i < model_.freeEnd(); ++i)
      at(f_.data(), i) = at(nodeForce_, i) + model_.nodeMass[i] * g;
    for (int i = model_.freeBegin(); i < model_.rotating(); ++i) at(t_.data(), i) = at(nodeMoment_, i);
    nodeForce_ = f_.data();
    nodeMoment_ = t_.data();
  }
  if (!fs_.empty()) {  // a scene of springs alone has no slaves
    std::copy_n(slaveForce_, fs_.size(), fs_.begin());
    std::copy_n(slaveMoment_, ms_.size(), ms_.begin());
    slaveForce_ = fs_.data();
    slaveMoment_ = ms_.data();
    if (gravity_)
      for (int s = 0; s < model_.slaves(); ++s)
        at(fs_.data(), s) += field(Field::slaveMass)[s] * model_.settings.gravity;
  }
  if (springs_.empty() && !ports_.anyOfSlaves()) return;
  if (layout_[Field::position].count > 0) slaves_.updatePositions();
  if (ports_.anyOfSlaves()) {
    ports_.shape(slaves_.position(), [&](int k) { return springs_.rotation(k); });
    ports_.distributeLoads(field(Field::portForce), field(Field::portMoment), fs_.data(), ms_.data());
  }
  if (!springs_.empty()) springs_.addLoads(v, w, {f_.data(), t_.data(), fs_.data(), ms_.data()});
}

}  // namespace tiefmu
