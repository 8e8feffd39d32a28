// The one list of what a simulation holds. Every number that a caller sets or gets and every number that a step changes
// belongs to one of these fields; where they stand (layout.hpp), what Python calls them and the FMU's variables
// (modelDescription/variables.cpp) follow from this table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <type_traits>
#include <utility>

namespace tiefmu {

// In the order of memory. Where code relies on this order it asserts it (`adjacent`, `allAre`).
enum class Field : std::uint8_t {
  timeStep,
  safety,
  threads,
  slaveMass,
  slaveInertia,
  addedMass,
  addedInertia,
  stiffness,
  rotationalStiffness,
  nodeForce,
  nodeMoment,
  slaveForce,
  slaveMoment,
  portForce,
  portMoment,
  portVelocity,
  portSpin,
  portAcceleration,
  portAngularAcceleration,
  acceleration,
  angularAcceleration,
  velocity,
  spin,
  position,
  offset,
  segmentRotation,
  orientation,
  angle,
  portPlace,
  portRotation,
  work,
  heldAcceleration,
  accelerationChange,
  lagged,
  predicted,
  guess,
  increment,
  jump,
  solution,
  mode,
  highestFrequency,
  dampingRate,
  angleTurned,
  integratorLimit,
  slaveVelocity,
  slaveSpin,
  reactionForce,
  reactionMoment,
  slavePosition,
  slaveAcceleration,
  portReaction,
  portReactionMoment,
  portMeanVelocity,
  portMeanSpin,
  portPosition,
  energy,
  powerResidual,
  drift,
  stableTimeStep,
  nodalTimeStep,
};

// Entries of Field::work, Field::energy and Field::solution.
struct Work {
  enum Entry : int { external, dissipated, totalAtStart, totalAtLastStep, entries };
};
struct Energy {
  enum Entry : int { kinetic, strain, dissipated, external, residual, entries };
};
// See Correction (inertia.hpp). A guess worse than none is left: afresh is 1 then.
struct Solution {
  enum Entry : int { residual, energy, afresh, residualInStep, jumpEnergy, entries };
};

enum class Role : std::uint8_t {
  parameter,
  calculated,  // from the parameters, at the end of the initialisation
  input,
  motion,  // of nodes: an input where driven, a state or its rate where free, zero where fixed
  state,   // what a step changes and cannot compute anew
  output,
};

// What a field has one row for.
enum class Per : std::uint8_t {
  simulation,
  node,
  rotatingNode,
  nodeThenRotatingNode,      // all nodes, then the rotating ones again
  freeNodeThenRotatingNode,  // of the free nodes
  slave,
  turningSlave,
  drivenPort,  // of driven nodes
  slavePort,   // of slaves
  port,        // of driven nodes, then of slaves
  frame,       // meanMotion segment
  orientedEnd,
};

// When a model has the field at all.
enum class When : std::uint8_t {
  always,
  free,                // some node is free
  accelerationInputs,  // accelerations of what is driven are inputs
  accelerations,       // somebody asks for accelerations of nodes
  positions,           // somebody asks for positions of nodes
  framesTurn,          // somebody asks for the rotations of meanMotion segments
  anglesAdd,           // small displacements of ties that follow rotations
  finite,              // finite displacements
  led,                 // reactions that run ahead
  damped,              // free nodes with dampers
  biased,              // free nodes whose accelerations depend on their velocities
  iterated,            // free nodes whose accelerations an iteration finds
  modeKept,            // free nodes on springs that turn
  exposed,             // interface.expose names it
};

struct FieldRow {
  Field field;
  const char* name;  // in Python
  const char* unit;  // of all its entries; "1": none
  int components;    // doubles a row
  Per per;
  Role role;
  When when = When::always;
  const char* exposedAs = nullptr;  // When::exposed: its name in interface.expose
};

// clang-format off
inline constexpr FieldRow fieldRows[] = {
    {Field::timeStep, "time_step", "s", 1, Per::simulation, Role::parameter},  // 0: safety times the limit
    {Field::safety, "safety", "1", 1, Per::simulation, Role::parameter},
    {Field::threads, "threads", "1", 1, Per::simulation, Role::parameter},
    {Field::slaveMass, "slave_mass", "kg", 1, Per::slave, Role::parameter},
    {Field::slaveInertia, "slave_inertia", "kg.m2", 1, Per::turningSlave, Role::parameter},

    {Field::addedMass, "added_mass", "kg", 1, Per::node, Role::calculated},
    {Field::addedInertia, "added_inertia", "kg.m2", 1, Per::rotatingNode, Role::calculated},
    {Field::stiffness, "stiffness", "N/m", 1, Per::node, Role::calculated},
    {Field::rotationalStiffness, "rotational_stiffness", "N.m/rad", 1, Per::rotatingNode, Role::calculated},

    {Field::nodeForce, "node_force", "N", 3, Per::node, Role::input, When::free},
    {Field::nodeMoment, "node_moment", "N.m", 3, Per::rotatingNode, Role::input, When::free},
    {Field::slaveForce, "slave_force", "N", 3, Per::slave, Role::input},
    {Field::slaveMoment, "slave_moment", "N.m", 3, Per::turningSlave, Role::input},
    {Field::portForce, "port_force", "N", 3, Per::slavePort, Role::input},
    {Field::portMoment, "port_moment", "N.m", 3, Per::slavePort, Role::input},
    {Field::portVelocity, "port_velocity", "m/s", 3, Per::drivenPort, Role::input},
    {Field::portSpin, "port_spin", "rad/s", 3, Per::drivenPort, Role::input},
    {Field::portAcceleration, "port_acceleration", "m/s2", 3, Per::drivenPort, Role::input, When::accelerationInputs},
    {Field::portAngularAcceleration, "port_angular_acceleration", "rad/s2", 3, Per::drivenPort, Role::input,
     When::accelerationInputs},

    {Field::acceleration, "acceleration", "m/s2", 3, Per::node, Role::motion, When::accelerations},
    {Field::angularAcceleration, "angular_acceleration", "rad/s2", 3, Per::rotatingNode, Role::motion,
     When::accelerations},
    {Field::velocity, "velocity", "m/s", 3, Per::node, Role::motion},
    {Field::spin, "spin", "rad/s", 3, Per::rotatingNode, Role::motion},
    {Field::position, "position", "m", 3, Per::node, Role::motion, When::positions},

    {Field::offset, "offset", "m", 3, Per::turningSlave, Role::state},                            // d now
    {Field::segmentRotation, "segment_rotation", "1", 4, Per::frame, Role::state, When::framesTurn},  // quaternions
    {Field::orientation, "orientation", "1", 4, Per::orientedEnd, Role::state},                    // quaternions
    {Field::angle, "angle", "rad", 3, Per::rotatingNode, Role::state, When::anglesAdd},            // integral of spin
    {Field::portPlace, "port_place", "m", 3, Per::drivenPort, Role::state},                        // reference points
    {Field::portRotation, "port_rotation", "1", 4, Per::drivenPort, Role::state, When::finite},    // since the start
    {Field::work, "work", "J", Work::entries, Per::simulation, Role::state, When::exposed, "energy"},
    {Field::heldAcceleration, "held_acceleration", "m/s2, rad/s2", 3, Per::nodeThenRotatingNode, Role::state,
     When::led},  // of driven nodes, in the last step
    {Field::accelerationChange, "acceleration_change", "m/s2, rad/s2", 3, Per::nodeThenRotatingNode, Role::state,
     When::led},  // from that of the step before it
    {Field::lagged, "lagged_velocity", "m/s, rad/s", 3, Per::nodeThenRotatingNode, Role::state,
     When::damped},  // that the last damping forces used
    {Field::predicted, "predicted_velocity", "m/s, rad/s", 3, Per::nodeThenRotatingNode, Role::state,
     When::biased},  // that the last bias used
    {Field::guess, "acceleration_guess", "m/s2, rad/s2", 3, Per::freeNodeThenRotatingNode, Role::state,
     When::iterated},  // where the solution for the present accelerations starts
    {Field::increment, "acceleration_increment", "m/s2, rad/s2", 3, Per::freeNodeThenRotatingNode, Role::state,
     When::iterated},  // over the last substep, under the same inputs
    {Field::jump, "acceleration_jump", "m/s2, rad/s2", 3, Per::freeNodeThenRotatingNode, Role::state,
     When::iterated},  // with the last change of inputs
    {Field::solution, "acceleration_solution", "1", Solution::entries, Per::simulation, Role::state,
     When::iterated},
    {Field::mode, "mode", "1", 3, Per::freeNodeThenRotatingNode, Role::state, When::modeKept},  // of highestFrequency
    {Field::highestFrequency, "highest_frequency", "rad/s", 1, Per::simulation, Role::state},   // a bound
    {Field::dampingRate, "damping_rate", "1/s", 1, Per::simulation, Role::state},               // bound of M^-1 C
    {Field::angleTurned, "angle_turned", "rad", 1, Per::simulation, Role::state},  // since highestFrequency was found
    {Field::integratorLimit, "integrator_limit", "s", 1, Per::simulation, Role::state},  // that follows from both bounds

    {Field::slaveVelocity, "slave_velocity", "m/s", 3, Per::slave, Role::output},
    {Field::slaveSpin, "slave_spin", "rad/s", 3, Per::turningSlave, Role::output},
    {Field::reactionForce, "reaction_force", "N", 3, Per::node, Role::output},
    {Field::reactionMoment, "reaction_moment", "N.m", 3, Per::rotatingNode, Role::output},
    {Field::slavePosition, "slave_position", "m", 3, Per::slave, Role::output, When::exposed, "slave.r"},
    {Field::slaveAcceleration, "slave_acceleration", "m/s2", 3, Per::slave, Role::output, When::exposed, "slave.a"},
    {Field::portReaction, "port_reaction", "N", 3, Per::drivenPort, Role::output},
    {Field::portReactionMoment, "port_reaction_moment", "N.m", 3, Per::drivenPort, Role::output},
    {Field::portMeanVelocity, "port_mean_velocity", "m/s", 3, Per::slavePort, Role::output},
    {Field::portMeanSpin, "port_mean_spin", "rad/s", 3, Per::slavePort, Role::output},
    {Field::portPosition, "port_position", "m", 3, Per::port, Role::output, When::exposed, "port.r"},
    {Field::energy, "energy", "J", Energy::entries, Per::simulation, Role::output, When::exposed, "energy"},
    {Field::powerResidual, "power_residual", "W", 1, Per::simulation, Role::output, When::exposed, "power_residual"},
    {Field::drift, "drift", "m", 1, Per::simulation, Role::output, When::exposed, "drift"},
    {Field::stableTimeStep, "stable_time_step", "s", 1, Per::simulation, Role::output},
    {Field::nodalTimeStep, "nodal_time_step", "s", 1, Per::simulation, Role::output},
};
// clang-format on

inline constexpr std::size_t fieldCount = std::size(fieldRows);

constexpr std::size_t indexOf(Field f) { return static_cast<std::size_t>(f); }
constexpr const FieldRow& rowOf(Field f) { return fieldRows[indexOf(f)]; }

namespace detail {

consteval bool fieldRowsAreComplete() {
  for (std::size_t i = 0; i < fieldCount; ++i) {
    const FieldRow& row = fieldRows[i];
    if (indexOf(row.field) != i || !row.name || !row.unit || row.components < 1) return false;
    if ((row.when == When::exposed) != (row.exposedAs != nullptr)) return false;
  }
  return fieldRows[fieldCount - 1].field == Field::nodalTimeStep;  // the last of the enumeration
}

}  // namespace detail

static_assert(detail::fieldRowsAreComplete(), "one row for each field, in the order of the enumeration");

// body(std::integral_constant<Field, f>) for each field in order.
template <class Body> constexpr void forEachField(Body body) {
  [&]<std::size_t... i>(std::index_sequence<i...>) {
    (body(std::integral_constant<Field, static_cast<Field>(i)>{}), ...);
  }(std::make_index_sequence<fieldCount>{});
}

// Does `b` follow `a` in memory, so that both are one array?
constexpr bool adjacent(Field a, Field b) { return indexOf(a) + 1 == indexOf(b); }

// Have all fields from `first` to `last` one of these roles?
template <class... Roles> constexpr bool allAre(Field first, Field last, Roles... roles) {
  for (std::size_t i = indexOf(first); i <= indexOf(last); ++i)
    if (!((fieldRows[i].role == roles) || ...)) return false;
  return first <= last;
}

}  // namespace tiefmu
