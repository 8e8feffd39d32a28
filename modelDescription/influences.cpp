#include "influences.hpp"

#include <algorithm>

#include "port.hpp"
#include "segment.hpp"

namespace tiefmu {

Influences::Influences(const Model& m, const Layout& l, const std::vector<Block>& blocks)
    : nodeForce(m.nodes()),
      nodeMoment(m.nodes()),
      reactionForce(m.nodes() + m.drivenPorts()),
      reactionMoment(m.nodes() + m.drivenPorts()),
      inertialForce(m.nodes() + m.drivenPorts()),
      inertialMoment(m.nodes() + m.drivenPorts()),
      addedMass(m.nodes()),
      addedInertia(m.nodes()),
      model(m),
      layout(l),
      referenceAt(l.size, noReference) {
  for (const Block& b : blocks) {
    references_ = b.reference + static_cast<std::uint32_t>(b.count());
    if (b.causality != Causality::input && b.causality != Causality::parameter) continue;
    for (std::size_t i = 0; i < b.count(); ++i) referenceAt[b.place + i] = b.reference + static_cast<std::uint32_t>(i);
    shapesChange |= b.field == Field::position && model.finite();
  }
  findMembers();
  findSprings();
  findReactions();
  findAdditions();
  findInertialLoads();
  findMeans();
}

// Of w in w x arm, or of f in arm x f.
Pattern Influences::turning(const Vec3& arm) const {
  if (arm.isZero(0)) return {};
  return model.finite() ? moving(crossPattern) : patternOf(skew(arm));
}

void Influences::addVelocity(List& to, Pattern left, int body) const {
  const std::size_t port = portOf(body);
  if (port == none) return add(to, left, known(Field::velocity, body));
  add(to, left, known(Field::portVelocity, static_cast<int>(port)));
  if (body < model.nodes()) add(to, left * armOf(body), known(Field::portSpin, static_cast<int>(port)));
}

void Influences::addSpin(List& to, Pattern left, int body) const {
  const std::size_t port = portOf(body);
  if (port == none) return add(to, left, known(Field::spin, body));
  if (body < model.rotating() || body >= model.nodes()) add(to, left, known(Field::portSpin, static_cast<int>(port)));
}

void Influences::addAcceleration(List& to, Pattern left, int body) const {
  if (isFree(body)) return add(to, left, references_ + 6 * static_cast<std::uint32_t>(body - model.freeBegin()));
  const std::size_t port = portOf(body);
  if (port == none) return add(to, left, known(Field::acceleration, body));
  if (!model.accelerationInputs()) return;
  add(to, left, known(Field::portAcceleration, static_cast<int>(port)));
  if (body >= model.nodes()) return;
  add(to, left * armOf(body), known(Field::portAngularAcceleration, static_cast<int>(port)));
  if (model.finite() && !armOf(body).empty())
    add(to, left * moving(fullPattern), known(Field::portSpin, static_cast<int>(port)));
}

void Influences::addAngularAcceleration(List& to, Pattern left, int body) const {
  if (body >= model.rotating() && body < model.nodes()) return;
  if (isFree(body)) return add(to, left, references_ + 6 * static_cast<std::uint32_t>(body - model.freeBegin()) + 3);
  const std::size_t port = portOf(body);
  add(to, left,
      port == none ? known(Field::angularAcceleration, body)
                   : known(Field::portAngularAcceleration, static_cast<int>(port)));
}

Segment Influences::segment(const TieGroup& g, int e) const {
  Segment s{g,
            &g.node[static_cast<std::size_t>(g.corners) * e],
            g.firstSlave + g.begin[e],
            g.firstSlave + g.begin[e + 1],
            g.corners,
            {},
            Mat3::Zero(),
            {}};
  std::copy_n(s.node, g.corners, s.body);
  const std::size_t port = portOf(s.node[0]);
  if (port != none && std::all_of(s.node, s.node + g.corners, [&](int node) { return portOf(node) == port; })) {
    s.bodies = 1;
    s.body[0] = model.nodes() + static_cast<int>(port);
    return s;
  }
  if (g.coupling != Coupling::meanMotion || model.finite()) return s;
  Vec3 centre = Vec3::Zero();
  for (int i = 0; i < g.corners; ++i) centre += at(model.nodePosition.data(), s.node[i]) / g.corners;
  Mat3 ibar = Mat3::Zero();
  for (int i = 0; i < g.corners; ++i) {
    s.arm[i] = at(model.nodePosition.data(), s.node[i]) - centre;
    ibar += unitInertia(s.arm[i]);
  }
  s.inverse = ibar.inverse();
  return s;
}

void Influences::corners(const Segment& s, int slave, CornerMap maps[4]) const {
  const Vec3 d = at(model.slaveOffset.data(), slave);
  if (s.body[0] >= model.nodes()) {  // v + w x r
    Vec3 r = -model.ports[portOf(s.body[0])].place;
    const bool mean = s.group.coupling == Coupling::meanMotion;
    for (int i = 0; i < s.group.corners; ++i)
      r += (mean ? 1.0 / s.group.corners : weight(s, slave, i)) * at(model.nodePosition.data(), s.node[i]);
    const bool turns = kinematicsOf(s.group.coupling).slavesTurn;
    if (turns) r += d;
    maps[0] = {identityPattern, turning(r), {}, turns ? identityPattern : Pattern{}};
    return;
  }
  for (int i = 0; i < s.group.corners; ++i) {
    CornerMap map;
    switch (s.group.coupling) {
      case Coupling::meanMotion:
        map.wv = model.finite() ? moving(fullPattern) : patternOf(s.inverse * skew(s.arm[i]));
        if (!hasOffset(slave))
          map.vv = identityPattern;
        else if (model.finite())
          map.vv = moving(fullPattern);
        else
          map.vv = patternOf(Mat3::Identity() / s.group.corners - skew(d) * s.inverse * skew(s.arm[i]));
        break;
      case Coupling::rotation:
        if (weight(s, slave, i) == 0) break;
        map.vv = map.ww = identityPattern;
        if (hasOffset(slave)) map.vw = model.finite() ? moving(crossPattern) : patternOf(-skew(d));
        break;
      case Coupling::translation:
        if (weight(s, slave, i) != 0) map.vv = identityPattern;
        break;
    }
    maps[i] = map;
  }
}

Influences::Motion Influences::motion(const Segment& s, int slave) const {
  Motion result;
  auto& [v, w, x] = result;
  CornerMap maps[4];
  corners(s, slave, maps);
  const bool mean = s.group.coupling == Coupling::meanMotion;
  for (int i = 0; i < s.bodies; ++i) {
    const int body = s.body[i];
    addVelocity(v, maps[i].vv, body);
    addSpin(v, maps[i].vw, body);
    addVelocity(w, maps[i].wv, body);
    addSpin(w, maps[i].ww, body);
    if (body >= model.nodes()) return result;  // its place is a state
    const std::uint32_t position = known(Field::position, body);
    add(x, mean && model.finite() ? identityPattern : maps[i].vv, position);
    if (mean && shapesChange) {
      if (hasOffset(slave)) add(v, moving(fullPattern), position);
      add(w, moving(fullPattern), position);
    }
  }
  return result;
}

// How b of a slave (theory 2) depends on one corner: its translational part on v and w, its rotational part on v.
Influences::Bias Influences::bias(const Segment& s, int slave, int corner) const {
  Bias b;
  if (!model.finite()) return b;
  if (s.body[0] >= model.nodes()) {
    if (model.accelerationInputs() || (kinematicsOf(s.group.coupling).slavesTurn && hasOffset(slave)))
      b.onW = moving(fullPattern);
    return b;
  }
  switch (s.group.coupling) {
    case Coupling::meanMotion:
      if (hasOffset(slave)) b.onV = moving(fullPattern);
      b.onZ = moving(fullPattern);
      break;
    case Coupling::rotation:
      if (hasOffset(slave) && weight(s, slave, corner) != 0) b.onW = moving(fullPattern);
      break;
    case Coupling::translation: break;
  }
  return b;
}

List Influences::acceleration(const Segment& s, int slave) const {
  List a;
  CornerMap maps[4];
  corners(s, slave, maps);
  for (int i = 0; i < s.bodies; ++i) {
    const int body = s.body[i];
    addAcceleration(a, maps[i].vv, body);
    addAngularAcceleration(a, maps[i].vw, body);
    const Bias b = bias(s, slave, i);
    addVelocity(a, b.onV, body);
    addSpin(a, b.onW, body);
    if (s.group.coupling == Coupling::meanMotion && shapesChange && hasOffset(slave))
      add(a, moving(fullPattern), known(Field::position, body));
  }
  return a;
}

void Influences::findSprings() {
  sprung.assign(static_cast<std::size_t>(model.slaves()), -1);
  int count = 0;
  for (const Spring& spring : model.springs)
    for (const SpringEnd* end : {&spring.a, &spring.b})
      if (end->slave >= 0 && sprung[end->slave] < 0) sprung[end->slave] = count++;
  std::vector<Motion> ends(static_cast<std::size_t>(count));
  eachSegment([&](const Segment& s) {
    for (int slave = s.first; slave < s.last; ++slave)
      if (const int k = sprung[slave]; k >= 0) ends[static_cast<std::size_t>(k)] = motion(s, slave);
  });
  slaveForce.resize(count);
  slaveMoment.resize(count);
  for (const Spring& spring : model.springs) addSpring(spring, ends);
  for (int node = model.freeBegin(); node < model.freeEnd(); ++node) {
    add(nodeForce[node], identityPattern, known(Field::nodeForce, node));
    add(nodeMoment[node], identityPattern, known(Field::nodeMoment, node));
  }
}

void Influences::addSpring(const Spring& spring, const std::vector<Motion>& ends) {
  struct Load { List force, moment; } a, b;
  const Pattern cross = moving(crossPattern), full = moving(fullPattern);
  const Pattern stiff = diagonalPattern(spring.stiffness), damped = diagonalPattern(spring.damping);
  const Pattern twisted = diagonalPattern(spring.rotationalDamping);
  const bool axial = spring.kind == SpringKind::axial, beam = spring.kind == SpringKind::beam;
  const bool bTurns =
      spring.b.slave >= 0 ? spring.b.slave < model.turning() : spring.b.node >= 0 && spring.b.node < model.rotating();
  for (const SpringEnd* end : {&spring.a, &spring.b}) {
    Motion of;
    auto& [ev, ew, ex] = of;
    if (end->slave >= 0) {
      of = ends[static_cast<std::size_t>(sprung[end->slave])];
    } else if (end->node >= 0) {
      addVelocity(ev, identityPattern, end->node);
      addSpin(ew, identityPattern, end->node);
      add(ex, identityPattern, known(Field::position, end->node));
    }
    List force;  // on either end
    if (axial) {
      if (spring.stiffness[0] != 0 || spring.damping[0] != 0) add(force, full, ex);
      if (spring.damping[0] != 0) add(force, full, ev);
    } else if (beam) {  // its axes turn, and with them everything
      if (!stiff.empty() || !damped.empty()) add(force, full, ex);
      if (!damped.empty()) add(force, full, ev);
      if (!damped.empty()) add(force, full, ew);
      for (List* moment : {&a.moment, &b.moment}) {
        add(*moment, full, force);
        if (!twisted.empty()) add(*moment, full, ew);
      }
    } else {  // K (line - R_b arm) + C (rate of line - w_b x line)
      add(force, stiff, ex);
      if (bTurns) add(force, damped * cross, ex);
      add(force, damped, ev);
      if (end == &spring.b) add(force, damped * cross, ew);
      add(a.moment, twisted, ew);
      add(b.moment, twisted, ew);
      add(b.moment, cross, force);  // the shear force over the distance
      if (!stiff.empty() || !damped.empty()) add(b.moment, cross, ex);
    }
    add(a.force, identityPattern, force);
    add(b.force, identityPattern, force);
  }
  const auto apply = [&](const SpringEnd& end, const Load& load) {
    if (end.slave >= 0) {
      add(slaveForce[sprung[end.slave]], identityPattern, load.force);
      if (end.slave < model.turning()) add(slaveMoment[sprung[end.slave]], identityPattern, load.moment);
    } else if (end.node >= 0) {
      add(nodeForce[end.node], identityPattern, load.force);
      if (end.node < model.rotating()) add(nodeMoment[end.node], identityPattern, load.moment);
    }
  };
  apply(spring.a, a);
  apply(spring.b, b);
}

// T^T f_s (theory 3)
void Influences::findReactions() {
  List force, moment;
  CornerMap maps[4];
  const Pattern weightOf = diagonalPattern(model.settings.gravity) * scalarPattern;
  eachSegment([&](const Segment& s) {
    for (int slave = s.first; slave < s.last; ++slave) {
      force.clear();
      moment.clear();
      add(force, weightOf, known(Field::slaveMass, slave, 1));
      add(force, identityPattern, known(Field::slaveForce, slave));
      add(moment, identityPattern, known(Field::slaveMoment, slave));
      addPortLoads(slave, force, moment);
      if (const int k = sprung[slave]; k >= 0) {
        add(force, identityPattern, slaveForce[k]);
        add(moment, identityPattern, slaveMoment[k]);
      }
      corners(s, slave, maps);
      for (int i = 0; i < s.bodies; ++i) {
        const CornerMap& map = maps[i];
        add(reactionForce[s.body[i]], transposed(map.vv), force);
        add(reactionForce[s.body[i]], transposed(map.wv), moment);
        add(reactionMoment[s.body[i]], transposed(map.vw), force);
        add(reactionMoment[s.body[i]], transposed(map.ww), moment);
      }
    }
    if (s.group.coupling == Coupling::meanMotion && shapesChange)
      for (int i = 0; i < s.group.corners; ++i)
        for (int j = 0; j < s.group.corners; ++j)
          add(reactionForce[s.node[i]], moving(fullPattern), known(Field::position, s.node[j]));
  });
  // Loads of ports of slaves that one port of driven nodes moves arrive there whole.
  for (std::size_t q = model.drivenPorts(); q < model.ports.size(); ++q) {
    const int k = static_cast<int>(q - model.drivenPorts()), body = slavePorts[static_cast<std::size_t>(k)].body;
    if (body < 0) continue;
    const std::array<Pattern, 3> motion = asOne(q);
    add(reactionForce[body], transposed(motion[0]), known(Field::portForce, k));
    add(reactionMoment[body], transposed(motion[1]), known(Field::portForce, k));
    add(reactionMoment[body], transposed(motion[2]), known(Field::portMoment, k));
  }
}

// D_i of the parameters (theory 4, lumped)
void Influences::findAdditions() {
  eachSegment([&](const Segment& s) {
    for (int slave = s.first; slave < s.last; ++slave) {
      const std::uint32_t m = known(Field::slaveMass, slave, 1), own = known(Field::slaveInertia, slave, 1);
      const int n = s.group.corners;
      const Phi phi = clamped(n, &s.group.weight[static_cast<std::size_t>(slave - s.group.firstSlave) * n]);
      for (int i = 0; i < n; ++i) {
        const bool mean = s.group.coupling == Coupling::meanMotion;
        if (!mean && phi[i] == 0) continue;
        add(addedMass[s.node[i]], scalarPattern, m);
        if (mean) add(addedMass[s.node[i]], scalarPattern, own);
        if (s.group.coupling == Coupling::rotation) {
          if (hasOffset(slave)) add(addedInertia[s.node[i]], scalarPattern, m);
          add(addedInertia[s.node[i]], scalarPattern, own);
        }
      }
    }
  });
}

void Influences::findInertialLoads() {
  if (model.settings.inertia == Inertia::consistent) {
    eachSegment([&](const Segment& s) { addInertialLoads(s); });
    return;
  }
  std::vector<std::uint8_t> master(static_cast<std::size_t>(model.nodes()), 0);
  for (const TieGroup& g : model.groups)
    for (int node : g.node) master[static_cast<std::size_t>(node)] = 1;
  for (int node = 0; node < model.nodes(); ++node) {
    if (!isFree(node) && !master[static_cast<std::size_t>(node)]) continue;  // a tie adds nothing to a point
    const Pattern mass = addedMass[node].empty() ? identityPattern : changing(identityPattern);
    const Pattern inertia = addedInertia[node].empty() ? identityPattern : changing(identityPattern);
    addAcceleration(inertialForce[node], mass, node);
    addAngularAcceleration(inertialMoment[node], inertia, node);
    if (!inertialForce[node].empty()) add(inertialForce[node], moving(identityPattern), addedMass[node]);
    if (!inertialMoment[node].empty()) add(inertialMoment[node], moving(identityPattern), addedInertia[node]);
    if (isFree(node)) coupled.push_back({node, node, {mass, {}, {}, inertia}});
  }
}

// T^T M_s (T q'' + b) of the slaves on one segment (theory 4, consistent)
void Influences::addInertialLoads(const Segment& s) {
  const int n = s.bodies;
  CornerMap maps[4], mass[4][4] = {};
  struct BiasLoad { Pattern forceV, forceW, momentV, momentW; } biases[4][4] = {};
  for (int slave = s.first; slave < s.last; ++slave) {
    const std::uint32_t massParameter = known(Field::slaveMass, slave, 1);
    const std::uint32_t inertiaParameter = known(Field::slaveInertia, slave, 1);
    Pattern m, own;
    if (massParameter != noReference)
      m = changing(identityPattern);
    else if (model.slaveMass[slave] != 0)
      m = identityPattern;
    if (inertiaParameter != noReference)
      own = changing(identityPattern);
    else if (slave < model.turning() && model.slaveInertia[slave] != 0)
      own = identityPattern;
    if (m.empty() && own.empty()) continue;
    corners(s, slave, maps);
    for (int i = 0; i < n; ++i) {
      const Pattern vv = transposed(maps[i].vv) * m, vw = transposed(maps[i].vw) * m;
      const Pattern wv = transposed(maps[i].wv) * own, ww = transposed(maps[i].ww) * own;
      for (int j = 0; j < n; ++j) {
        mass[i][j].vv = mass[i][j].vv + vv * maps[j].vv + wv * maps[j].wv;
        mass[i][j].vw = mass[i][j].vw + vv * maps[j].vw + wv * maps[j].ww;
        mass[i][j].wv = mass[i][j].wv + vw * maps[j].vv + ww * maps[j].wv;
        mass[i][j].ww = mass[i][j].ww + vw * maps[j].vw + ww * maps[j].ww;
        const auto [onV, onW, onZ] = bias(s, slave, j);
        biases[i][j].forceV = biases[i][j].forceV + vv * onV + wv * onZ;
        biases[i][j].forceW = biases[i][j].forceW + vv * onW;
        biases[i][j].momentV = biases[i][j].momentV + vw * onV + ww * onZ;
        biases[i][j].momentW = biases[i][j].momentW + vw * onW;
      }
      const Pattern any = moving(scalarPattern);
      if (!vv.empty()) add(inertialForce[s.body[i]], any, massParameter);
      if (!vw.empty()) add(inertialMoment[s.body[i]], any, massParameter);
      if (!wv.empty()) add(inertialForce[s.body[i]], any, inertiaParameter);
      if (!ww.empty()) add(inertialMoment[s.body[i]], any, inertiaParameter);
    }
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int node = s.body[i], other = s.body[j];
      List& force = inertialForce[node];
      List& moment = inertialMoment[node];
      addAcceleration(force, mass[i][j].vv, other);
      addAngularAcceleration(force, mass[i][j].vw, other);
      addAcceleration(moment, mass[i][j].wv, other);
      addAngularAcceleration(moment, mass[i][j].ww, other);
      addVelocity(force, biases[i][j].forceV, other);
      addSpin(force, biases[i][j].forceW, other);
      addVelocity(moment, biases[i][j].momentV, other);
      addSpin(moment, biases[i][j].momentW, other);
      if (isFree(node) && isFree(other)) coupled.push_back({node, other, mass[i][j]});
    }
}

}  // namespace tiefmu
