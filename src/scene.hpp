// What the caller describes: nodes, segments, ties, springs and settings, as plain arrays in SI units.
// Everything refers to nodes and segments by their index in these arrays; ids are kept for reports and messages.
#pragma once

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "math.hpp"

namespace tiefmu {

enum class Motion : std::uint8_t { driven, free, fixed };
enum class Formulation : std::uint8_t { standard, optimized };  // Spotflag 0 and 1; "default" is a C++ keyword
enum class SearchMethod : std::uint8_t { box, nearestNode };    // Isearch 2 and 1
enum class SpringKind : std::uint8_t { axial, bushing, beam };
enum class Inertia : std::uint8_t { lumped, consistent };
enum class Reaction : std::uint8_t { loads, full, split };
enum class Geometry : std::uint8_t { finite, small };
enum class Position : std::uint8_t { integrated, input };
enum class Method : std::uint8_t { centralDifference, symplecticEuler, nohBathe, rk4 };
enum class Names : std::uint8_t { structured, flat };  // of the FMU's variables

// The words of a scene file for an enumeration, in its order. Python calls the values so, with _ for -.
template <class E> inline constexpr std::array<const char*, 0> words{};
template <> inline constexpr auto words<Motion> = std::array{"driven", "free", "fixed"};
template <> inline constexpr auto words<Formulation> = std::array{"default", "optimized"};
template <> inline constexpr auto words<SearchMethod> = std::array{"box", "nearest-node"};
template <> inline constexpr auto words<SpringKind> = std::array{"axial", "bushing", "beam"};
template <> inline constexpr auto words<Inertia> = std::array{"lumped", "consistent"};
template <> inline constexpr auto words<Reaction> = std::array{"loads", "full", "split"};
template <> inline constexpr auto words<Geometry> = std::array{"finite", "small"};
template <> inline constexpr auto words<Position> = std::array{"integrated", "input"};
template <>
inline constexpr auto words<Method> = std::array{"central-difference", "symplectic-euler", "noh-bathe", "rk4"};
template <> inline constexpr auto words<Names> = std::array{"structured", "flat"};

struct SceneNodes {
  std::vector<std::int64_t> id;
  std::vector<Vec3> position;               // m
  std::vector<Motion> motion;               // ignored for slaves
  std::vector<std::uint8_t> rotations;      // 1: the node has rotational freedom
  std::vector<double> mass;                 // kg
  std::vector<double> inertia;              // kg m2, spherical
  std::vector<double> stiffness;            // N/m, declared nodal stiffness of what the scene does not hold
  std::vector<double> rotationalStiffness;  // N m/rad
  std::vector<Vec3> velocity;               // m/s at the start
  std::vector<Vec3> spin;                   // rad/s at the start
};

struct SceneSegments {
  std::vector<std::int64_t> id;
  std::vector<std::array<int, 4>> nodes;  // node indices; the fourth is -1 for a triangle
};

struct SceneTie {
  std::string name;
  std::vector<int> segments;
  std::vector<int> slaves;
  Formulation formulation{};
  SearchMethod search{};
  double searchDistance = 0;  // m; 0: root mean square of the master edges (box), longest diagonal (nearestNode)
  bool dropUnresolved = false;
};

struct SceneSpring {
  std::string name;  // how messages call it, e.g. "spring 2"
  int a = -1;        // node index
  int b = -1;        // node index, or -1: ground at the start position of a
  SpringKind kind{};
  Vec3 stiffness = Vec3::Zero();            // N/m; axial: the first entry; beam: along its own axes
  Vec3 damping = Vec3::Zero();              // N s/m
  Vec3 rotationalStiffness = Vec3::Zero();  // N m/rad
  Vec3 rotationalDamping = Vec3::Zero();    // N m s/rad
  Vec3 orientation = Vec3::Zero();          // of a beam: the side of its second axis; zero: global y, or z along y
};

constexpr int mostThreads = 256;
// Nodes that the interface shows as one rigid body: driven ones that it moves, or slaves that it loads.
struct ScenePort {
  std::string name;
  std::vector<int> nodes;
  bool listed = false;     // by ids: each must be part of the model; of a set those that are not are passed over
  bool atMean = true;      // reference point: the mean of its nodes' positions, or `at`
  Vec3 at = Vec3::Zero();  // m
};

// The tables [model], [integrator] and [interface]. What a scene leaves out python/tiefmu/schema.py fills in: here are
// no defaults but zeros.
struct Settings {
  Inertia inertia{};
  Reaction reaction{};
  double reactionLead = 0;  // from 0 to 1, theory (5.11)
  Geometry geometry{};
  Position position{};
  Vec3 gravity = Vec3::Zero();  // m/s2
  double solverTolerance = 0;   // of consistent inertia: residual over right side, above 0
  Method method{};
  double timeStep = 0;  // s; 0: safety * limit
  double safety = 0;    // above 0
  int threads = 0;      // from 1 to mostThreads; 0: one, and no parameter of the FMU
  Names names{};
  std::vector<std::string> expose, hide;  // names of modelDescription/table.hpp
};

// All members of Settings by their keys in a scene, for Python and for the FMU's resource.
template <class T> struct SettingsMember {
  const char* key;
  T Settings::* member;
};
inline constexpr std::tuple settingsMembers{SettingsMember{"inertia", &Settings::inertia},
                                            SettingsMember{"reaction", &Settings::reaction},
                                            SettingsMember{"reaction_lead", &Settings::reactionLead},
                                            SettingsMember{"geometry", &Settings::geometry},
                                            SettingsMember{"position", &Settings::position},
                                            SettingsMember{"solver_tolerance", &Settings::solverTolerance},
                                            SettingsMember{"gravity", &Settings::gravity},
                                            SettingsMember{"method", &Settings::method},
                                            SettingsMember{"time_step", &Settings::timeStep},
                                            SettingsMember{"safety", &Settings::safety},
                                            SettingsMember{"threads", &Settings::threads},
                                            SettingsMember{"names", &Settings::names},
                                            SettingsMember{"expose", &Settings::expose},
                                            SettingsMember{"hide", &Settings::hide}};

namespace detail {

struct Anything { template <class T> operator T() const; };

// How many members an aggregate has: how many initialisers it takes.
template <class S, class... Given> consteval std::size_t memberCount() {
  if constexpr (requires { S{Given{}..., Anything{}}; })
    return memberCount<S, Given..., Anything>();
  else
    return sizeof...(Given);
}

}  // namespace detail

static_assert(std::tuple_size_v<decltype(settingsMembers)> == detail::memberCount<Settings>(),
              "a member of Settings is missing from settingsMembers");

// A unit of the scene's own, for messages; everything here is in SI.
struct Unit {
  std::string name;
  double si = 1;  // what one of it is in SI
};

struct Scene {
  SceneNodes nodes;
  SceneSegments segments;
  std::vector<SceneTie> ties;
  std::vector<SceneSpring> springs;
  std::vector<ScenePort> ports;
  Settings settings;
  Unit length{"m", 1}, mass{"kg", 1};
};

// A scene that cannot be modelled. `what()` is one line that starts with the table it speaks of,
// e.g. "tie 'weld': slave 101: ...".
struct SceneError : std::runtime_error { using std::runtime_error::runtime_error; };

}  // namespace tiefmu
