// The one table of FMU variables: which fields of src/fields.hpp an FMU shows, of what, under which name, and how.
// Units and numbers of components are those of the fields. The XML, get and set, dependencies, Python's names and
// reports are written from it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "../src/fields.hpp"

namespace tiefmu {

enum class Causality : std::uint8_t { parameter, calculatedParameter, input, output };

// Whose a variable is: bits, as a row may speak of several kinds of nodes. Nodes and slaves of ports have no variables.
enum class Owner : std::uint16_t {
  scene = 1,
  drivenMaster = 2,
  freeMaster = 4,
  fixedMaster = 8,
  drivenPoint = 16,
  freePoint = 32,
  slave = 64,
  drivenPort = 128,  // of driven nodes
  slavePort = 256,   // of slaves
};
constexpr Owner operator|(Owner a, Owner b) {
  return static_cast<Owner>(static_cast<std::uint16_t>(a) | static_cast<std::uint16_t>(b));
}
constexpr bool overlap(Owner a, Owner b) {
  return (static_cast<std::uint16_t>(a) & static_cast<std::uint16_t>(b)) != 0;
}

// First part of the name of an owner's variables: master[1].v[3]. The scene's have none.
constexpr std::string_view prefixOf(Owner owner) {
  if (owner == Owner::scene) return "";
  if (overlap(owner, Owner::drivenMaster | Owner::freeMaster | Owner::fixedMaster)) return "master";
  if (overlap(owner, Owner::drivenPoint | Owner::freePoint)) return "point";
  return owner == Owner::slave ? "slave" : "port";
}

enum class Shown : std::uint8_t {
  always,
  exposed,             // if interface.expose lists it
  exposedUnlessGiven,  // the same, where positions are not inputs
  positionsGiven,      // where positions are inputs
  accelerationsGiven,  // where accelerations are inputs
  withFreeNodes,
  withThreads,  // if the scene says how many
  withMoment,   // of nodes that get a moment from a tie: corners of segments whose slaves follow their rotation
};

// What an unknown depends on at one instant; dependencies.cpp has one case for each. Unstated it is `all`, which is
// always right: an absent list in the XML.
enum class DependsOn : std::uint8_t {
  all,      // or a sum over the whole model
  nothing,  // a state, or a constant
  addedMass,
  addedInertia,
  reactionForce,
  reactionMoment,
  slaveVelocity,
  slaveSpin,
  slavePosition,
  slaveAcceleration,
  portReaction,
  portReactionMoment,
  portMeanVelocity,
  portMeanSpin,
};

struct Variable {
  Owner owner;
  Field field;
  std::string_view name;
  Causality causality;
  Shown shown;
  std::string_view description;
  DependsOn dependsOn = DependsOn::all;
  std::string_view group = {};  // name in expose and hide where it is not "prefix.name"
  int entry = 0;                // of a field of the scene

  constexpr std::string_view prefix() const { return prefixOf(owner); }
  constexpr const FieldRow& row() const { return rowOf(field); }
  constexpr int components() const { return owner == Owner::scene ? 1 : row().components; }
  // Does `text` name it in expose and hide?
  constexpr bool isListedAs(std::string_view text) const {
    if (!group.empty()) return text == group;
    const std::size_t n = prefix().size();
    if (n == 0) return text == name;
    return text.size() == n + 1 + name.size() && text.substr(0, n) == prefix() && text[n] == '.' &&
           text.substr(n + 1) == name;
  }
  constexpr bool isExtra() const { return shown == Shown::exposed || shown == Shown::exposedUnlessGiven; }
};

namespace detail {

using enum Owner;
using enum Causality;
using enum Shown;
using D = DependsOn;
using F = Field;

// In the order in which messages list the names of expose and hide.
// clang-format off
inline constexpr Variable variableRows[] = {
    {scene, F::timeStep, "integrator.time_step", parameter, withFreeNodes, "time step; 0: safety times the limit"},
    {scene, F::safety, "integrator.safety", parameter, withFreeNodes, "part of the limit that a time step may take"},
    {scene, F::threads, "integrator.threads", parameter, withThreads, "threads that share a step; results do not depend on it"},
    {scene, F::stableTimeStep, "stable_time_step", output, withFreeNodes, "limit 2/omega_max of the assembled system"},
    {scene, F::nodalTimeStep, "nodal_time_step", output, withFreeNodes, "smallest sqrt(2 m/K) of all master nodes"},
    {scene, F::energy, "energy.kinetic", output, exposed, "kinetic energy", D::all, "energy", Energy::kinetic},
    {scene, F::energy, "energy.strain", output, exposed, "strain energy of the springs", D::all, "energy", Energy::strain},
    {scene, F::energy, "energy.dissipated", output, exposed, "work done on the dampers", D::all, "energy", Energy::dissipated},
    {scene, F::energy, "energy.external", output, exposed, "work of external loads and driven nodes", D::all, "energy", Energy::external},
    {scene, F::energy, "energy.residual", output, exposed, "energy that the balance does not account for", D::all, "energy", Energy::residual},
    {scene, F::powerResidual, "power_residual", output, exposed, "sum of force times velocity over the interface"},
    {scene, F::drift, "drift", output, exposed, "largest change of an offset's length since the start", D::nothing},

    {drivenMaster, F::velocity, "v", input, always, "velocity"},
    {freeMaster, F::velocity, "v", output, always, "velocity", D::nothing},
    {drivenMaster, F::spin, "w", input, always, "angular velocity"},
    {freeMaster, F::spin, "w", output, always, "angular velocity", D::nothing},
    {drivenMaster, F::acceleration, "a", input, accelerationsGiven, "acceleration"},
    {drivenMaster, F::angularAcceleration, "z", input, accelerationsGiven, "angular acceleration"},
    {drivenMaster, F::position, "r", input, positionsGiven, "position"},
    {drivenMaster, F::position, "r", output, exposedUnlessGiven, "position", D::nothing},
    {freeMaster, F::position, "r", output, exposed, "position", D::nothing},
    {freeMaster, F::nodeForce, "f_ext", input, always, "external force on the node"},
    {freeMaster, F::nodeMoment, "t_ext", input, always, "external moment on the node"},
    {drivenMaster | freeMaster | fixedMaster, F::reactionForce, "f", output, always, "reaction: force of the tie on the node", D::reactionForce},
    {drivenMaster | freeMaster | fixedMaster, F::reactionMoment, "t", output, withMoment, "reaction: moment of the tie on the node", D::reactionMoment},
    {drivenMaster | freeMaster, F::addedMass, "added_mass", calculatedParameter, always, "mass that the tie adds to the node", D::addedMass},
    {drivenMaster | freeMaster, F::addedInertia, "added_inertia", calculatedParameter, always, "inertia that the tie adds to the node", D::addedInertia},
    {drivenMaster | freeMaster, F::stiffness, "stiffness", calculatedParameter, exposed, "nodal stiffness, slaves included", D::nothing},
    {drivenMaster | freeMaster, F::rotationalStiffness, "rotational_stiffness", calculatedParameter, exposed, "rotational nodal stiffness, slaves included", D::nothing, "master.stiffness"},

    {slave, F::slaveForce, "f", input, always, "external force on the slave"},
    {slave, F::slaveMoment, "t", input, always, "external moment on the slave"},
    {slave, F::slaveVelocity, "v", output, always, "velocity", D::slaveVelocity},
    {slave, F::slaveSpin, "w", output, always, "angular velocity", D::slaveSpin},
    {slave, F::slavePosition, "r", output, exposed, "position", D::slavePosition},
    {slave, F::slaveAcceleration, "a", output, exposed, "acceleration", D::slaveAcceleration},
    {slave, F::slaveMass, "mass", parameter, exposed, "mass of the slave"},
    {slave, F::slaveInertia, "inertia", parameter, exposed, "rotary inertia of the slave"},

    {drivenPoint, F::velocity, "v", input, always, "velocity"},
    {freePoint, F::velocity, "v", output, always, "velocity", D::nothing},
    {drivenPoint, F::spin, "w", input, always, "angular velocity"},
    {freePoint, F::spin, "w", output, always, "angular velocity", D::nothing},
    {freePoint, F::nodeForce, "f_ext", input, always, "external force on the node"},
    {freePoint, F::nodeMoment, "t_ext", input, always, "external moment on the node"},
    {drivenPoint | freePoint, F::position, "r", output, exposed, "position", D::nothing},

    {drivenPort, F::portVelocity, "v", input, always, "velocity of the reference point"},
    {slavePort, F::portMeanVelocity, "v", output, always, "velocity of the reference point", D::portMeanVelocity},
    {drivenPort, F::portSpin, "w", input, always, "angular velocity"},
    {slavePort, F::portMeanSpin, "w", output, always, "angular velocity", D::portMeanSpin},
    {drivenPort, F::portAcceleration, "a", input, accelerationsGiven, "acceleration of the reference point"},
    {drivenPort, F::portAngularAcceleration, "z", input, accelerationsGiven, "angular acceleration"},
    {drivenPort, F::portReaction, "f", output, always, "resultant force", D::portReaction},
    {slavePort, F::portForce, "f", input, always, "resultant force"},
    {drivenPort, F::portReactionMoment, "t", output, always, "resultant moment about the reference point", D::portReactionMoment},
    {slavePort, F::portMoment, "t", input, always, "resultant moment about the reference point"},
    {drivenPort | slavePort, F::portPosition, "r", output, exposed, "position of the reference point", D::nothing},
};
// clang-format on

constexpr bool isAllowed(Causality causality, Role role) {
  switch (role) {
    case Role::parameter: return causality == parameter;
    case Role::calculated: return causality == calculatedParameter;
    case Role::input: return causality == input;
    case Role::motion: return causality == input || causality == output;
    case Role::state: return false;
    case Role::output: return causality == output;
  }
  return false;
}

constexpr Owner ownersOf(Per per) {
  constexpr Owner nodes = drivenMaster | freeMaster | fixedMaster | drivenPoint | freePoint;
  switch (per) {
    case Per::simulation: return scene;
    case Per::node:
    case Per::rotatingNode: return nodes;
    case Per::slave:
    case Per::turningSlave: return slave;
    case Per::drivenPort: return drivenPort;
    case Per::slavePort: return slavePort;
    case Per::port: return drivenPort | slavePort;
    case Per::nodeThenRotatingNode:
    case Per::freeNodeThenRotatingNode:
    case Per::frame:
    case Per::orientedEnd: break;
  }
  return Owner{};
}

// A field that only the solver knows has the role `state`; every other is shown, each entry of the scene's once.
consteval bool everyFieldIsShown() {
  for (const FieldRow& field : fieldRows) {
    int entries = 0;
    for (const Variable& v : variableRows) entries += v.field == field.field;
    const bool right = field.role == Role::state      ? entries == 0
                       : field.per == Per::simulation ? entries == field.components
                                                      : entries > 0;
    if (!right) return false;
  }
  return true;
}

consteval bool rowsFitTheirFields() {
  for (const Variable& v : variableRows) {
    if (!isAllowed(v.causality, v.row().role) || (v.owner | ownersOf(v.row().per)) != ownersOf(v.row().per))
      return false;
    if (v.entry >= v.row().components || (v.entry > 0 && v.owner != scene)) return false;
    const bool known = v.causality == input || v.causality == parameter;
    if (known && v.dependsOn != D::all) return false;  // only unknowns depend on something
    if (v.row().exposedAs && !(v.isExtra() && v.isListedAs(v.row().exposedAs))) return false;
  }
  return true;
}

consteval bool namesAreUnique() {
  for (const Variable& a : variableRows)
    for (const Variable& b : variableRows)
      if (&a != &b && overlap(a.owner, b.owner) && a.name == b.name &&
          !(a.shown == positionsGiven && b.shown == exposedUnlessGiven) &&
          !(b.shown == positionsGiven && a.shown == exposedUnlessGiven))
        return false;
  return true;
}

static_assert(everyFieldIsShown(), "a field is missing from the table of variables, or shown twice");
static_assert(rowsFitTheirFields(), "causality, owner, entry or exposure of a variable contradict its field");
static_assert(namesAreUnique(), "two variables of the same owner have one name");

}  // namespace detail

using detail::variableRows;

}  // namespace tiefmu
