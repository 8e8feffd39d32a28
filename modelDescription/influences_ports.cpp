// What ports say of their nodes and slaves, and these of them.
#include <algorithm>

#include "../src/port.hpp"
#include "influences.hpp"

namespace tiefmu {

void Influences::findMembers() {
  for (std::size_t p = 0; p < model.ports.size(); ++p) {
    std::vector<Membership>& list = model.ports[p].ofSlaves ? slavePort : nodePort;
    if (list.empty()) list.resize(static_cast<std::size_t>(model.ports[p].ofSlaves ? model.slaves() : model.nodes()));
    for (std::size_t i = 0; i < model.ports[p].member.size(); ++i)
      list[static_cast<std::size_t>(model.ports[p].member[i])] = {p, i};
  }
  if (slavePort.empty()) return;
  std::vector<int> body(static_cast<std::size_t>(model.slaves()), -1);  // that alone moves the slave
  eachSegment([&](const Segment& s) {
    for (int slave = s.first; slave < s.last; ++slave)
      if (s.bodies == 1) body[static_cast<std::size_t>(slave)] = s.body[0];
  });
  for (std::size_t p = model.drivenPorts(); p < model.ports.size(); ++p) {
    const Port& port = model.ports[p];
    const auto turning = port.turnWeight > 0 ? std::count_if(port.member.begin(), port.member.end(),
                                                             [&](int slave) { return slave < model.turning(); })
                                             : 0;
    const Mat3 inertia = armInertia(port.arm) + static_cast<double>(turning) * port.turnWeight * Mat3::Identity();
    const int first = body[static_cast<std::size_t>(port.member[0])];
    const bool same = std::all_of(port.member.begin(), port.member.end(),
                                  [&](int slave) { return body[static_cast<std::size_t>(slave)] == first; });
    const bool rigid = std::all_of(port.member.begin(), port.member.end(),
                                   [&](int slave) { return slave < model.turning() || !hasOffset(slave); });
    slavePorts.push_back({same ? first : -1, rigid, inertia.inverse()});
  }
}

Pattern Influences::armOf(int node) const {
  const auto [port, index] = nodePort[static_cast<std::size_t>(node)];
  return turning(at(model.ports[port].arm.data(), static_cast<Eigen::Index>(index)));
}

// The motion of a port of slaves that one port of driven nodes moves: its velocity by that one's velocity and by its
// spin, and its spin by its spin. Slaves without rotations follow points beside them, and so not as a body.
std::array<Pattern, 3> Influences::asOne(std::size_t number) const {
  const Port& port = model.ports[number];
  const SlavePort& slaves = slavePorts[number - model.drivenPorts()];
  if (!slaves.rigid) {
    const auto now = [&](Pattern p) { return model.finite() ? moving(p) : changing(p); };
    return {identityPattern, now(port.lever.isZero(0) ? crossPattern : fullPattern), now(fullPattern)};
  }
  return {identityPattern, turning(port.place - model.ports[portOf(slaves.body)].place), identityPattern};
}

CornerMap Influences::portMap(std::size_t number, std::size_t index) const {
  const Port& port = model.ports[number];
  const int slave = port.member[index];
  const bool alone = port.member.size() == 1, lever = !port.lever.isZero(0);
  const bool turns = port.turnWeight > 0 && slave < model.turning();
  CornerMap map;
  map.vv = identityPattern;
  if (alone) {
    map.ww = identityPattern;
    if (lever) map.vw = model.finite() ? moving(crossPattern) : patternOf(skew(port.lever));
    return map;
  }
  if (model.finite()) {
    if (lever) map.vv = moving(fullPattern);
    map.wv = moving(fullPattern);
    if (turns) map.ww = moving(fullPattern);
    if (turns && lever) map.vw = moving(fullPattern);
    return map;
  }
  const Mat3& inverse = slavePorts[number - model.drivenPorts()].inverse;
  const Mat3 turn = inverse * skew(at(port.arm.data(), static_cast<Eigen::Index>(index)));
  map.vv = patternOf(Mat3::Identity() / static_cast<double>(port.member.size()) - skew(port.lever) * turn);
  map.wv = patternOf(turn);
  if (turns) map.ww = patternOf(inverse);
  if (turns && lever) map.vw = patternOf(skew(port.lever) * inverse);
  return map;
}

// What a port puts on one of its slaves.
void Influences::addPortLoads(int slave, List& force, List& moment) const {
  if (slavePort.empty() || slavePort[static_cast<std::size_t>(slave)].port == none) return;
  const auto [port, index] = slavePort[static_cast<std::size_t>(slave)];
  if (slavePorts[port - model.drivenPorts()].body >= 0) return;
  const CornerMap map = portMap(port, index);
  const int k = static_cast<int>(port - model.drivenPorts());
  add(force, transposed(map.vv), known(Field::portForce, k));
  add(force, transposed(map.wv), known(Field::portMoment, k));
  add(moment, transposed(map.vw), known(Field::portForce, k));
  add(moment, transposed(map.ww), known(Field::portMoment, k));
}

void Influences::findMeans() {
  const std::size_t first = model.drivenPorts();
  means.resize(model.ports.size() - first);
  if (means.empty()) return;
  for (std::size_t k = 0; k < means.size(); ++k) {
    const int body = slavePorts[k].body;
    if (body < 0) continue;
    const auto [velocity, turn, spin] = asOne(first + k);
    addVelocity(means[k].force, velocity, body);
    addSpin(means[k].force, turn, body);
    addSpin(means[k].moment, spin, body);
  }
  eachSegment([&](const Segment& s) {
    for (int slave = s.first; slave < s.last; ++slave) {
      const auto [port, index] = slavePort[static_cast<std::size_t>(slave)];
      if (port == none || slavePorts[port - first].body >= 0) continue;
      const auto [v, w, x] = motion(s, slave);
      const CornerMap map = portMap(port, index);
      Resultant& mean = means[port - first];
      add(mean.force, map.vv, v);
      add(mean.force, map.vw, w);
      add(mean.moment, map.wv, v);
      add(mean.moment, map.ww, w);
    }
  });
}

Influences::Resultant Influences::resultant(std::size_t port, bool inertial) const {
  Resultant sum;
  const auto take = [&](const List& force, const List& moment, Pattern arm) {
    add(sum.force, identityPattern, force);
    add(sum.moment, arm, force);
    add(sum.moment, identityPattern, moment);
  };
  const std::size_t body = static_cast<std::size_t>(model.nodes()) + port;
  take(reactionForce[body], reactionMoment[body], {});
  if (inertial) take(inertialForce[body], inertialMoment[body], {});
  for (int member : model.ports[port].member) {
    const std::size_t node = static_cast<std::size_t>(member);
    take(reactionForce[node], reactionMoment[node], armOf(member));
    take(nodeForce[node], nodeMoment[node], armOf(member));
    if (inertial) take(inertialForce[node], inertialMoment[node], armOf(member));
  }
  return sum;
}

}  // namespace tiefmu
