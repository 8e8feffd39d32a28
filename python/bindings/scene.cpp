// What a scene file says, as the solver takes it.
#include <nanobind/eigen/dense.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <tuple>

#include "../../src/model.hpp"
#include "bindings.hpp"
#include "convert.hpp"

namespace tiefmu {
namespace {

using Ids = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Corners = nb::ndarray<const std::int32_t, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using Bytes = nb::ndarray<const std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

std::vector<Vec3> vectors(const Vectors& array) {
  std::vector<Vec3> result(array.shape(0));
  for (std::size_t i = 0; i < result.size(); ++i) result[i] = at(array.data(), static_cast<Eigen::Index>(i));
  return result;
}

std::vector<int> indices(const Indices& array, std::size_t limit, int lowest, const char* what) {
  std::vector<int> result(array.data(), array.data() + array.shape(0));
  for (int i : result)
    require(i >= lowest && i < static_cast<int>(limit), std::string(what) + ": index " + std::to_string(i));
  return result;
}

template <class T, class Array> std::vector<T> list(const Array& array) {
  return std::vector<T>(array.data(), array.data() + array.shape(0));
}

void setNodes(Scene& scene, const Ids& id, const Vectors& position, const Bytes& motion, const Bytes& rotations,
              const Doubles& mass, const Doubles& inertia, const Doubles& stiffness, const Doubles& rotationalStiffness,
              const Vectors& velocity, const Vectors& spin) {
  const std::size_t n = id.shape(0);
  for (std::size_t count : {position.shape(0), motion.shape(0), rotations.shape(0), mass.shape(0), inertia.shape(0),
                            stiffness.shape(0), rotationalStiffness.shape(0), velocity.shape(0), spin.shape(0)})
    require(count == n, "set_nodes: arrays of different length");
  SceneNodes& nodes = scene.nodes;
  nodes.id = list<std::int64_t>(id);
  nodes.position = vectors(position);
  nodes.motion.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    require(motion.data()[i] <= 2, "set_nodes: motion is 0 (driven), 1 (free) or 2 (fixed)");
    nodes.motion[i] = static_cast<Motion>(motion.data()[i]);
  }
  nodes.rotations = list<std::uint8_t>(rotations);
  nodes.mass = list<double>(mass);
  nodes.inertia = list<double>(inertia);
  nodes.stiffness = list<double>(stiffness);
  nodes.rotationalStiffness = list<double>(rotationalStiffness);
  nodes.velocity = vectors(velocity);
  nodes.spin = vectors(spin);
}

void setSegments(Scene& scene, const Ids& id, const Corners& nodes) {
  require(id.shape(0) == nodes.shape(0), "set_segments: arrays of different length");
  const int limit = static_cast<int>(scene.nodes.id.size());
  scene.segments.id = list<std::int64_t>(id);
  scene.segments.nodes.resize(nodes.shape(0));
  for (std::size_t e = 0; e < nodes.shape(0); ++e)
    for (std::size_t i = 0; i < 4; ++i) {
      const int node = nodes.data()[4 * e + i];
      require(node < limit && node >= (i == 3 ? -1 : 0), "set_segments: node index " + std::to_string(node));
      scene.segments.nodes[e][i] = node;
    }
}

void addTie(Scene& scene, const std::string& name, const Indices& segments, const Indices& slaves,
            Formulation formulation, SearchMethod search, double searchDistance, bool dropUnresolved) {
  SceneTie tie;
  tie.name = name;
  tie.segments = indices(segments, scene.segments.id.size(), 0, "add_tie: segments");
  tie.slaves = indices(slaves, scene.nodes.id.size(), 0, "add_tie: slaves");
  tie.formulation = formulation;
  tie.search = search;
  tie.searchDistance = searchDistance;
  tie.dropUnresolved = dropUnresolved;
  scene.ties.push_back(std::move(tie));
}

void addSprings(Scene& scene, const std::string& name, const Indices& a, const Indices& b, SpringKind kind,
                const std::array<double, 3>& stiffness, const std::array<double, 3>& damping,
                const std::array<double, 3>& rotationalStiffness, const std::array<double, 3>& rotationalDamping,
                const std::array<double, 3>& orientation) {
  require(a.shape(0) == b.shape(0), "add_springs: arrays of different length");
  const std::vector<int> first = indices(a, scene.nodes.id.size(), 0, "add_springs: a");
  const std::vector<int> second = indices(b, scene.nodes.id.size(), -1, "add_springs: b");
  SceneSpring spring;
  spring.name = name;
  spring.kind = kind;
  spring.stiffness = at(stiffness.data(), 0);
  spring.damping = at(damping.data(), 0);
  spring.rotationalStiffness = at(rotationalStiffness.data(), 0);
  spring.rotationalDamping = at(rotationalDamping.data(), 0);
  spring.orientation = at(orientation.data(), 0);
  for (std::size_t i = 0; i < first.size(); ++i) {
    spring.a = first[i];
    spring.b = second[i];
    scene.springs.push_back(spring);
  }
}

void addPort(Scene& scene, const std::string& name, const Indices& nodes, bool listed, const Doubles& reference) {
  require(reference.shape(0) == 0 || reference.shape(0) == 3, "add_port: at has no or three numbers");
  ScenePort port;
  port.name = name;
  port.nodes = indices(nodes, scene.nodes.id.size(), 0, "add_port: nodes");
  port.listed = listed;
  port.atMean = reference.shape(0) == 0;
  if (!port.atMean) port.at = at(reference.data(), 0);
  scene.ports.push_back(std::move(port));
}

template <class E> void bindEnum(nb::module_& m, const char* name, const char* doc) {
  nb::enum_<E> bound(m, name, doc);
  for (std::size_t i = 0; i < words<E>.size(); ++i) {
    std::string word = words<E>[i];
    std::replace(word.begin(), word.end(), '-', '_');
    bound.value(word.c_str(), static_cast<E>(i));
  }
}

void bindSettings(nb::module_& m) {
  nb::class_<Settings> bound(m, "Settings",
                             "The tables [model], [integrator] and [interface], in SI. New ones hold zeros: the "
                             "defaults are those of schema.py.");
  bound.def(nb::init<>());
  std::apply([&](const auto&... each) { (bound.def_rw(each.key, each.member), ...); }, settingsMembers);
}

}  // namespace

void bindScene(nb::module_& m) {
  bindEnum<Motion>(m, "Motion", "Of a node: as the numbers of Scene.set_nodes and Model.report.");
  bindEnum<Coupling>(m, "Coupling", "How a slave follows its segment: as the numbers of Model.report.");
  bindEnum<Formulation>(m, "Formulation", "Of a tie.");
  bindEnum<SearchMethod>(m, "SearchMethod", "Of a tie.");
  bindEnum<SpringKind>(m, "SpringKind", "Of springs.");
  bindEnum<Inertia>(m, "Inertia", "Of the slaves.");
  bindEnum<Reaction>(m, "Reaction", "What the reactions on driven nodes hold.");
  bindEnum<Geometry>(m, "Geometry", "Of displacements.");
  bindEnum<Position>(m, "Position", "Of driven nodes.");
  bindEnum<Method>(m, "Method", "Of integration.");
  bindEnum<Names>(m, "Names", "Of the variables of an FMU.");
  bindSettings(m);

  nb::class_<Scene>(m, "Scene", "Nodes, segments, ties and springs as arrays, by index. SI units.")
      .def(nb::init<>())
      .def("set_nodes", &setNodes, "id"_a, "position"_a, "motion"_a, "rotations"_a, "mass"_a, "inertia"_a,
           "stiffness"_a, "rotational_stiffness"_a, "velocity"_a, "spin"_a,
           "id (n) int64; position, velocity, spin (n, 3); motion (n) uint8: of Motion; rotations (n) uint8: 0 or 1; "
           "the rest (n).")
      .def("set_segments", &setSegments, "id"_a, "nodes"_a,
           "id (n) int64; nodes (n, 4) int32 node indices, a triangle's fourth is -1. After set_nodes.")
      .def("add_tie", &addTie, "name"_a, "segments"_a, "slaves"_a, "formulation"_a, "search"_a, "search_distance"_a,
           "drop_unresolved"_a,
           "segments, slaves: int32 indices; search_distance: m, 0: root mean square of the master edges.")
      .def("add_springs", &addSprings, "name"_a, "a"_a, "b"_a, "kind"_a, "stiffness"_a, "damping"_a,
           "rotational_stiffness"_a, "rotational_damping"_a, "orientation"_a,
           "One spring for each pair of a and b (int32 node indices; b = -1: ground), all of the same kind.")
      .def("add_port", &addPort, "name"_a, "nodes"_a, "listed"_a, "at"_a,
           "nodes: int32 indices; listed: by ids, so that each must be part of the model; at: [x, y, z], or empty for "
           "the mean of the nodes' positions.")
      .def(
          "set_units",
          [](Scene& scene, const std::string& length, double metres, const std::string& mass, double kilograms) {
            scene.length = {length, metres};
            scene.mass = {mass, kilograms};
          },
          "length"_a, "metres"_a, "mass"_a, "kilograms"_a,
          "Names of the units in which messages give lengths and masses, and how many m and kg they are.")
      .def_rw("settings", &Scene::settings);
}

}  // namespace tiefmu
