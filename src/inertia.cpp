#include "inertia.hpp"

#include <algorithm>
#include <string>

#include "inertia_direct.hpp"
#include "inertia_iterative.hpp"
#include "segment.hpp"

namespace tiefmu {
namespace {

// Up to this many unknowns (3-vectors) a fresh factor at every geometry costs little, and is exact to rounding.
constexpr int smallSystem = 40;

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
      // The second end of a bushing also carries the moment of the shear force.
      const double arm2 = spring.kind == SpringKind::bushing && end == &spring.b ? spring.arm.squaredNorm() : 0;
      if (end->slave >= 0) {
        k[end->slave] += stiffness;
        kr[end->slave] += turning + stiffness * arm2;
      } else if (end->node >= 0) {
        translation[end->node] += stiffness;
        if (end->node < model.rotating()) rotation[end->node] += turning + stiffness * arm2;
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

ConsistentInertia::ConsistentInertia(const Model& model)
    : model_(model), free_(model.free()), freeRotating_(model.rotating() - model.freeBegin()) {
  const bool shapes = std::any_of(model.groups.begin(), model.groups.end(),
                                  [](const TieGroup& g) { return g.coupling == Coupling::meanMotion; });
  const bool offsets = std::any_of(model.slaveOffset.begin(), model.slaveOffset.begin() + 3 * model.turning(),
                                   [](double d) { return d != 0; });
  constant_ = !model.finite() || model.turning() == 0 || (!shapes && !offsets);
}

void ConsistentInertia::refuse(int freeNode, bool turn) const {
  throw SceneError("node " + std::to_string(model_.nodeId[model_.freeBegin() + freeNode]) + ": is free but has no " +
                   (turn ? "inertia" : "mass") +
                   " of its own, and the slaves tied to it do not give it enough for a consistent mass matrix");
}

std::unique_ptr<ConsistentInertia> ConsistentInertia::of(const Model& model) {
  const int unknowns = model.free() + model.rotating() - model.freeBegin();
  return model.turning() == 0 || unknowns <= smallSystem ? directInertia(model) : iterativeInertia(model);
}

}  // namespace tiefmu
