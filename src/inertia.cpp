#include "inertia.hpp"

#include <algorithm>
#include <string>

#include "inertia_direct.hpp"
#include "inertia_iterative.hpp"
#include "segment.hpp"

namespace tiefmu {
namespace {

// Below this tolerance a constant factor of the translations is cheaper than iterations.
constexpr double manyDigits = 1e-6;

// Calls body(group, segment, slave (global), local slave) in order.
template <class Body> void eachSlave(const Model& model, Body body) {
  for (const TieGroup& group : model.groups)
    for (int e = 0; e < group.segments(); ++e)
      for (int k = group.begin[e]; k < group.begin[e + 1]; ++k) body(group, e, group.firstSlave + k, k);
}

// lambda of a segment at the start, from the nodes' start positions.
double lambdaAtStart(const Model& model, const TieGroup& group, int e) {
  Vec3 x[4];
  for (int i = 0; i < group.corners; ++i)
    x[i] = at(model.nodePosition.data(), group.node[static_cast<std::size_t>(group.corners) * e + i]);
  return nodeInertia(group.corners, x).lambda;
}

// Calls add(slave, corner, node, mass, inertia, does the node get inertia?) for every corner of every slave's segment.
// [theory (4.1), (4.2)]
template <class Add>
void eachAddition(const Model& model, const double* slaveMass, const double* slaveInertia, Add add) {
  double lambda = 0;
  const TieGroup* lastGroup = nullptr;
  int lastSegment = -1;
  eachSlave(model, [&](const TieGroup& group, int e, int s, int k) {
    const int n = group.corners, *node = &group.node[static_cast<std::size_t>(n) * e];
    const double m = slaveMass[s], own = s < model.turning() ? slaveInertia[s] : 0;
    const double d2 = at(model.slaveOffset.data(), s).squaredNorm();
    if (group.coupling == Coupling::meanMotion) {
      if (&group != lastGroup || e != lastSegment) {
        lambda = lambdaAtStart(model, group, e);
        lastGroup = &group;
        lastSegment = e;
      }
      for (int i = 0; i < n; ++i) add(s, i, node[i], m / n + (own + m * d2) * lambda, 0.0, false);
      return;
    }
    const Phi phi = clamped(n, &group.weight[static_cast<std::size_t>(n) * k]);
    const bool turns = group.coupling == Coupling::rotation;
    for (int i = 0; i < n; ++i) add(s, i, node[i], phi[i] * m, turns ? phi[i] * (own + m * d2) : 0.0, turns);
  });
}

}  // namespace

void lumpedAdditions(const Model& model, const double* slaveMass, const double* slaveInertia, double* mass,
                     double* inertia) {
  std::fill(mass, mass + model.nodes(), 0.0);
  std::fill(inertia, inertia + model.rotating(), 0.0);
  eachAddition(model, slaveMass, slaveInertia, [&](int, int, int node, double m, double j, bool turns) {
    mass[node] += m;
    if (turns) inertia[node] += j;
  });
}

void lumpedAdditionsBySlave(const Model& model, const double* slaveMass, const double* slaveInertia, double* mass,
                            double* inertia) {
  std::fill(mass, mass + 4 * model.slaves(), 0.0);
  std::fill(inertia, inertia + 4 * model.slaves(), 0.0);
  eachAddition(model, slaveMass, slaveInertia, [&](int s, int corner, int, double m, double j, bool) {
    mass[4 * s + corner] = m;
    inertia[4 * s + corner] = j;
  });
}

void nodalStiffness(const Model& model, double* translation, double* rotation) {
  std::copy(model.nodeStiffness.begin(), model.nodeStiffness.end(), translation);
  std::copy_n(model.nodeRotationalStiffness.begin(), model.rotating(), rotation);
  std::vector<double> k = model.slaveStiffness, kr = model.slaveRotationalStiffness;
  k.resize(model.slaves());
  kr.resize(model.slaves());
  for (const Spring& spring : model.springs) {
    const double stiffness = spring.stiffness.maxCoeff(), turning = spring.rotationalStiffness.maxCoeff();
    for (const SpringEnd* end : {&spring.a, &spring.b}) {
      // The second end of a bushing also carries the moment of the shear force, and both ends of a beam.
      double shear = 0;
      if (spring.kind == SpringKind::bushing && end == &spring.b)
        shear = stiffness * spring.arm.squaredNorm();
      else if (spring.kind == SpringKind::beam)
        shear = spring.stiffness.tail<2>().maxCoeff() * spring.arm.squaredNorm();
      if (end->slave >= 0) {
        k[end->slave] += stiffness;
        kr[end->slave] += turning + shear;
      } else if (end->node >= 0) {
        translation[end->node] += stiffness;
        if (end->node < model.rotating()) rotation[end->node] += turning + shear;
      }
    }
  }
  eachSlave(model, [&](const TieGroup& group, int e, int s, int local) {
    const int n = group.corners, *node = &group.node[static_cast<std::size_t>(n) * e];
    const double d2 = at(model.slaveOffset.data(), s).squaredNorm();
    if (group.coupling == Coupling::meanMotion) {
      if (k[s] == 0 && kr[s] == 0) return;
      const double lambda = lambdaAtStart(model, group, e);
      for (int i = 0; i < n; ++i) translation[node[i]] += k[s] / n + lambda * (kr[s] + k[s] * d2);
      return;
    }
    const Phi phi = clamped(n, &group.weight[static_cast<std::size_t>(n) * local]);
    for (int i = 0; i < n; ++i) translation[node[i]] += phi[i] * k[s];
    if (group.coupling == Coupling::rotation)
      for (int i = 0; i < n; ++i) rotation[node[i]] += phi[i] * (kr[s] + k[s] * d2);
  });
}

SlaveBody slaveBody(const Model& model, const TieGroup& group, int segment, const double* slaveMass,
                    const double* slaveInertia) {
  SlaveBody body{0, Vec3::Zero(), {}};
  for (int s = group.firstSlave + group.begin[segment]; s < group.firstSlave + group.begin[segment + 1]; ++s) {
    const Vec3 d = at(model.slaveOffset.data(), s);
    const Mat3 inertia = slaveMass[s] * unitInertia(d) + slaveInertia[s] * Mat3::Identity();
    body.mass += slaveMass[s];
    body.moment += slaveMass[s] * d;
    int k = 0;
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j) body.inertia[k++] += inertia(i, j);
  }
  return body;
}

ConsistentInertia::ConsistentInertia(const Model& model, const std::vector<int>& nodes)
    : model_(model), node_(nodes), number_(model.free(), -1), free_(static_cast<int>(nodes.size())) {
  for (int k = 0; k < free_; ++k) number_[node_[k]] = k;
  const int rotating = model.rotating() - model.freeBegin();
  freeRotating_ = static_cast<int>(std::lower_bound(node_.begin(), node_.end(), rotating) - node_.begin());
  turning_ = meanMotion_ = false;
  bool offsets = false;
  for (const TieGroup& group : model.groups)
    for (int e = 0; e < group.segments(); ++e) {
      const int* corner = &group.node[static_cast<std::size_t>(group.corners) * e];
      if (std::none_of(corner, corner + group.corners, [&](int node) { return numberOf(node) >= 0; })) continue;
      turning_ |= group.coupling != Coupling::translation;
      meanMotion_ |= group.coupling == Coupling::meanMotion;
      if (group.coupling == Coupling::translation) continue;
      for (int k = 3 * (group.firstSlave + group.begin[e]); k < 3 * (group.firstSlave + group.begin[e + 1]); ++k)
        offsets |= model.slaveOffset[k] != 0;
    }
  constant_ = !model.finite() || !turning_ || (!meanMotion_ && !offsets);
}

void ConsistentInertia::refuse(int number, bool turn) const {
  throw SceneError("node " + std::to_string(model_.nodeId[model_.freeBegin() + node_[number]]) +
                   ": is free but has no " + (turn ? "inertia" : "mass") +
                   " of its own, and the slaves tied to it do not give it enough for a consistent mass matrix");
}

std::unique_ptr<ConsistentInertia> ConsistentInertia::of(const Model& model, const std::vector<int>& nodes) {
  if (nodes.empty()) return nullptr;
  return iterates(model, nodes) ? iterativeInertia(model, nodes) : directInertia(model, nodes);
}

bool ConsistentInertia::iterates(const Model& model, const std::vector<int>& nodes) {
  const int rotating = model.rotating() - model.freeBegin();
  const auto turning = std::lower_bound(nodes.begin(), nodes.end(), rotating) - nodes.begin();
  const bool small = static_cast<int>(nodes.size() + turning) <= smallSystem;
  if (model.turning() == 0) return !small && model.settings.solverTolerance >= manyDigits;
  // Only a factor shows whether the slaves give enough to nodes that have nothing of their own.
  const auto own = [&](const std::vector<double>& inertia, std::ptrdiff_t count) {
    return std::all_of(nodes.begin(), nodes.begin() + count, [&](int i) { return inertia[model.freeBegin() + i] > 0; });
  };
  return !small || (!nodes.empty() && own(model.nodeMass, std::ssize(nodes)) && own(model.nodeInertia, turning));
}

}  // namespace tiefmu
