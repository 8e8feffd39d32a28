// tiefmu._core: the solver, its table of variables and its packaging, for Python and NumPy. What it takes and gives is
// in SI units; arrays that it gives are copies.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <string>
#include <unordered_map>

#include "compile.hpp"
#include "inertia.hpp"
#include "resource.hpp"
#include "segment.hpp"
#include "simulation.hpp"
#include "stability.hpp"
#include "variables.hpp"
#include "xml.hpp"

namespace nb = nanobind;
using namespace nb::literals;

void bindKernels(nb::module_& module);  // kernels.cpp

namespace tiefmu {
namespace {

using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Ids = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Corners = nb::ndarray<const std::int32_t, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using Bytes = nb::ndarray<const std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

// A NumPy array of `shape` that owns `values`.
template <class T> nb::object numpy(std::vector<T> values, std::initializer_list<std::size_t> shape) {
  auto* owner = new std::vector<T>(std::move(values));
  nb::capsule guard(owner, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nb::ndarray<nb::numpy, T>(owner->data(), shape.size(), shape.begin(), guard).cast();
}
template <class T> nb::object numpy(std::vector<T> values) {
  const std::size_t n = values.size();
  return numpy(std::move(values), {n});
}

void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);
}

template <class E> E choose(const std::string& text, std::initializer_list<std::pair<const char*, E>> names) {
  for (const auto& [name, value] : names)
    if (text == name) return value;
  throw std::invalid_argument("unknown choice '" + text + "'");
}

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

// ---- Scene

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
            const std::string& formulation, const std::string& search, double searchDistance, bool dropUnresolved) {
  SceneTie tie;
  tie.name = name;
  tie.segments = indices(segments, scene.segments.id.size(), 0, "add_tie: segments");
  tie.slaves = indices(slaves, scene.nodes.id.size(), 0, "add_tie: slaves");
  tie.formulation =
      choose<Formulation>(formulation, {{"default", Formulation::standard}, {"optimized", Formulation::optimized}});
  tie.search = choose<SearchMethod>(search, {{"box", SearchMethod::box}, {"nearest-node", SearchMethod::nearestNode}});
  tie.searchDistance = searchDistance;
  tie.dropUnresolved = dropUnresolved;
  scene.ties.push_back(std::move(tie));
}

void addSprings(Scene& scene, const std::string& name, const Indices& a, const Indices& b, const std::string& kind,
                const std::array<double, 3>& stiffness, const std::array<double, 3>& damping,
                const std::array<double, 3>& rotationalStiffness, const std::array<double, 3>& rotationalDamping) {
  require(a.shape(0) == b.shape(0), "add_springs: arrays of different length");
  const std::vector<int> first = indices(a, scene.nodes.id.size(), 0, "add_springs: a");
  const std::vector<int> second = indices(b, scene.nodes.id.size(), -1, "add_springs: b");
  SceneSpring spring;
  spring.name = name;
  spring.kind = choose<SpringKind>(kind, {{"axial", SpringKind::axial}, {"bushing", SpringKind::bushing}});
  spring.stiffness = at(stiffness.data(), 0);
  spring.damping = at(damping.data(), 0);
  spring.rotationalStiffness = at(rotationalStiffness.data(), 0);
  spring.rotationalDamping = at(rotationalDamping.data(), 0);
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

void setSettings(Scene& scene, const std::string& inertia, const std::string& reaction, const std::string& geometry,
                 const std::string& position, const std::array<double, 3>& gravity, const std::string& method,
                 double timeStep, double safety, int threads, const std::vector<std::string>& expose,
                 const std::vector<std::string>& hide) {
  Settings& s = scene.settings;
  s.inertia = choose<Inertia>(inertia, {{"lumped", Inertia::lumped}, {"consistent", Inertia::consistent}});
  s.reaction =
      choose<Reaction>(reaction, {{"loads", Reaction::loads}, {"full", Reaction::full}, {"split", Reaction::split}});
  s.geometry = choose<Geometry>(geometry, {{"finite", Geometry::finite}, {"small", Geometry::small}});
  s.position = choose<Position>(position, {{"integrated", Position::integrated}, {"input", Position::input}});
  s.gravity = at(gravity.data(), 0);
  s.method = choose<Method>(method, {{"central-difference", Method::centralDifference},
                                     {"symplectic-euler", Method::symplecticEuler},
                                     {"noh-bathe", Method::nohBathe},
                                     {"rk4", Method::rk4}});
  s.timeStep = timeStep;
  s.safety = safety;
  s.threads = threads;
  s.expose = expose;
  s.hide = hide;
}

// ---- Model

std::shared_ptr<Model> compileScene(const Scene& scene) {
  checkInterface(scene);
  return std::make_shared<Model>(compile(scene));
}

const char* const couplingNames[] = {"rotation", "meanMotion", "translation"};

nb::dict reportSlaves(const Model& model) {
  const std::size_t n = model.slaveReport.size();
  std::vector<std::int64_t> segment(n), node(4 * n, 0);
  std::vector<std::int32_t> tie(n), coupling(n), corners(n);
  std::vector<double> xi(n), eta(n), distance(n), length(n), condition(n), lambda(n), weight(4 * n);
  std::vector<double> addedMass(4 * n), addedInertia(4 * n);
  std::vector<std::uint8_t> clamped(n);
  for (std::size_t s = 0; s < n; ++s) {
    const SlaveReport& r = model.slaveReport[s];
    segment[s] = r.segment;
    tie[s] = r.tie;
    xi[s] = r.xi;
    eta[s] = r.eta;
    distance[s] = r.distance;
    length[s] = at(model.slaveOffset.data(), static_cast<Eigen::Index>(s)).norm();
    clamped[s] = r.clamped;
  }
  for (const TieGroup& g : model.groups) {
    const std::size_t corner = static_cast<std::size_t>(g.corners);
    for (std::size_t e = 0; e + 1 < g.begin.size(); ++e) {
      Vec3 x[4];
      for (std::size_t i = 0; i < corner; ++i) x[i] = at(model.nodePosition.data(), g.node[corner * e + i]);
      const NodeInertia inertia = nodeInertia(g.corners, x);
      for (std::size_t k = static_cast<std::size_t>(g.begin[e]); k < static_cast<std::size_t>(g.begin[e + 1]); ++k) {
        const std::size_t s = static_cast<std::size_t>(g.firstSlave) + k;
        coupling[s] = static_cast<std::int32_t>(g.coupling);
        corners[s] = g.corners;
        for (std::size_t i = 0; i < corner; ++i) {
          node[4 * s + i] = model.nodeId[static_cast<std::size_t>(g.node[corner * e + i])];
          weight[4 * s + i] = g.weight[corner * k + i];
        }
        condition[s] = inertia.condition;
        lambda[s] = inertia.lambda;
      }
    }
  }
  lumpedAdditionsBySlave(model, model.slaveMass.data(), model.slaveInertia.data(), addedMass.data(),
                         addedInertia.data());
  nb::dict d;
  d["id"] = numpy(model.slaveId);
  d["number"] = numpy(model.slaveNumber);
  d["tie"] = numpy(std::move(tie));
  d["segment"] = numpy(std::move(segment));
  d["coupling"] = numpy(std::move(coupling));
  d["corners"] = numpy(std::move(corners));
  d["nodes"] = numpy(std::move(node), {n, 4});
  d["weights"] = numpy(std::move(weight), {n, 4});
  d["added_mass"] = numpy(std::move(addedMass), {n, 4});
  d["added_inertia"] = numpy(std::move(addedInertia), {n, 4});
  d["xi"] = numpy(std::move(xi));
  d["eta"] = numpy(std::move(eta));
  d["distance"] = numpy(std::move(distance));
  d["d"] = numpy(std::move(length));
  d["offset"] = numpy(model.slaveOffset, {n, 3});
  d["cond"] = numpy(std::move(condition));
  d["lambda"] = numpy(std::move(lambda));
  d["clamped"] = numpy(std::move(clamped));
  d["mass"] = numpy(model.slaveMass);
  d["inertia"] = numpy(model.slaveInertia);
  return d;
}

nb::dict reportNodes(const Model& model) {
  const std::size_t n = static_cast<std::size_t>(model.nodes());
  std::vector<std::uint8_t> master(n), motion(n);
  for (int g = 0; g < nodeGroups; ++g)
    for (int i = model.begin[static_cast<std::size_t>(g)]; i < model.begin[static_cast<std::size_t>(g) + 1]; ++i) {
      master[static_cast<std::size_t>(i)] = model.isMaster(g);
      const bool isFree = i >= model.freeBegin() && i < model.freeEnd();
      const bool fixed = g == rotatingFixedMaster || g == rotatingFixedPoint || g == fixedMaster || g == fixedPoint;
      motion[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(isFree  ? Motion::free
                                                                      : fixed ? Motion::fixed
                                                                              : Motion::driven);
    }
  nb::dict d;
  d["id"] = numpy(model.nodeId);
  d["number"] = numpy(model.nodeNumber);
  d["master"] = numpy(std::move(master));
  d["motion"] = numpy(std::move(motion));
  d["rotating"] = model.rotating();
  d["mass"] = numpy(model.nodeMass);
  d["inertia"] = numpy(model.nodeInertia);
  d["position"] = numpy(model.nodePosition, {n, 3});
  return d;
}

nb::list reportPorts(const Model& model) {
  nb::list result;
  for (const Port& port : model.ports) {
    std::vector<std::int64_t> ids;
    const std::vector<std::int64_t>& all = port.ofSlaves ? model.slaveId : model.nodeId;
    for (int k : port.member) ids.push_back(all[static_cast<std::size_t>(k)]);
    nb::dict d;
    d["name"] = port.name;
    d["number"] = port.number;
    d["of_slaves"] = port.ofSlaves != 0;
    d["ids"] = numpy(std::move(ids));
    d["at"] = std::vector<double>(port.place.begin(), port.place.end());
    result.append(d);
  }
  return result;
}

nb::dict report(const Model& model) {
  nb::list warnings, notes, dropped;
  for (const Finding& f : model.findings) (f.kind == Finding::warning ? warnings : notes).append(f.text);
  for (const Dropped& x : model.dropped) dropped.append(nb::make_tuple(x.id, x.tie, x.reason));
  nb::dict d;
  d["slaves"] = reportSlaves(model);
  d["nodes"] = reportNodes(model);
  d["couplings"] = std::vector<std::string>(std::begin(couplingNames), std::end(couplingNames));
  d["search_distance"] = model.searchDistance;
  d["springs"] = model.springs.size();
  d["ports"] = reportPorts(model);
  d["dropped"] = dropped;
  d["left_out"] = numpy(model.leftOut);
  d["warnings"] = warnings;
  d["notes"] = notes;
  return d;
}

// ---- Simulation

// A simulation with the FMU's view of it: fields by the names above, variables by their FMU names.
class Run {
 public:
  explicit Run(std::shared_ptr<Model> model)
      : simulation(std::move(model)), blocks(tiefmu::variables(simulation.model(), simulation.layout())) {}

  nb::object get(const std::string& name) {
    const FieldRow& f = find(name);
    simulation.updateOutputs();
    const Slice slice = simulation.layout()[f.field];
    std::vector<double> values(simulation.field(f.field), simulation.field(f.field) + slice.count);
    if (f.components == 1 || f.per == Per::simulation) return numpy(std::move(values));
    const auto components = static_cast<std::size_t>(f.components);
    return numpy(std::move(values), {slice.count / components, components});
  }

  void set(const std::string& name, const Values& values) {
    const FieldRow& f = find(name);
    const Slice slice = simulation.layout()[f.field];
    require(values.size() == slice.count, "field '" + name + "' has " + std::to_string(slice.count) + " values, not " +
                                              std::to_string(values.size()));
    std::copy_n(values.data(), slice.count, simulation.field(f.field));
    changed(f.field);
  }

  nb::dict fields() const {
    nb::dict d;
    for (const FieldRow& f : fieldRows)
      if (const std::size_t count = simulation.layout()[f.field].count) d[f.name] = count;
    return d;
  }

  nb::object getValues(const std::vector<std::string>& names) {
    simulation.updateOutputs();
    std::vector<double> values(names.size());
    for (std::size_t i = 0; i < names.size(); ++i) values[i] = simulation.data()[place(names[i]).second];
    return numpy(std::move(values));
  }

  void setValues(const std::vector<std::string>& names, const Doubles& values) {
    require(values.size() == names.size(), "as many values as names");
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto [block, at] = place(names[i]);
      require(block->causality == Causality::input || block->causality == Causality::parameter,
              "variable '" + names[i] + "' is neither an input nor a parameter");
      simulation.data()[at] = values.data()[i];
      changed(block->field);
    }
  }

  nb::list variables() const {
    static const char* const causalities[] = {"parameter", "calculatedParameter", "input", "output"};
    nb::list result;
    for (const Block& b : blocks) {
      nb::dict d;
      std::string name(b.prefix);
      if (!name.empty()) name += '.';
      d["name"] = name.append(b.name);
      d["prefix"] = b.prefix;
      d["components"] = b.components;
      d["causality"] = causalities[static_cast<int>(b.causality)];
      d["unit"] = b.unit;
      d["description"] = b.description;
      d["numbers"] = numpy(b.numbers);
      d["ids"] = numpy(b.ids);
      d["labels"] = b.labels;
      d["reference"] = b.reference;
      result.append(d);
    }
    return result;
  }

  std::vector<std::string> variableNames(std::size_t number) const {
    const Block& b = blocks.at(number);
    const std::size_t components = static_cast<std::size_t>(b.components);
    std::vector<std::string> names;
    for (std::size_t k = 0; k < b.count(); ++k)
      names.push_back(variableName(b, k / components, static_cast<int>(k % components)));
    return names;
  }

  Simulation simulation;

 private:
  static const FieldRow& find(const std::string& name) {
    for (const FieldRow& f : fieldRows)
      if (name == f.name) return f;
    throw nb::key_error(("no field '" + name + "'").c_str());
  }

  void changed(Field f) {
    rowOf(f).role == Role::parameter ? simulation.parametersChanged() : simulation.inputsChanged();
  }

  // Block of the variable and its place in the data.
  std::pair<const Block*, std::size_t> place(const std::string& name) {
    if (places.empty())
      for (const Block& b : blocks)
        for (std::size_t k = 0; k < b.count(); ++k) {
          const std::size_t components = static_cast<std::size_t>(b.components);
          places.emplace(variableName(b, k / components, static_cast<int>(k % components)), std::pair(&b, b.place + k));
        }
    const auto entry = places.find(name);
    if (entry == places.end()) throw nb::key_error(("no variable '" + name + "'").c_str());
    return entry->second;
  }

  std::vector<Block> blocks;
  std::unordered_map<std::string, std::pair<const Block*, std::size_t>> places;  // filled when first asked
};

}  // namespace
}  // namespace tiefmu

NB_MODULE(_core, m) {
  using namespace tiefmu;
  m.doc() = "The tied interface's solver; see src/scene.hpp, src/model.hpp and src/simulation.hpp.";
  nb::exception<SceneError>(m, "SceneError", PyExc_ValueError).attr("__doc__") =
      "A scene that cannot be read, modelled or started; one line 'FILE: table: id: message'.";
  nb::exception<Diverged>(m, "Diverged", PyExc_RuntimeError).attr("__doc__") =
      "A step ended in a non-finite or runaway number; the state before it has been put back.";
  nb::exception<StepTooLong>(m, "StepTooLong", PyExc_RuntimeError).attr("__doc__") =
      "A step that would take more substeps than any run could make; nothing has changed.";

  nb::class_<Scene>(m, "Scene", "Nodes, segments, ties and springs as arrays, by index. SI units.")
      .def(nb::init<>())
      .def("set_nodes", &setNodes, "id"_a, "position"_a, "motion"_a, "rotations"_a, "mass"_a, "inertia"_a,
           "stiffness"_a, "rotational_stiffness"_a, "velocity"_a, "spin"_a,
           "id (n) int64; position, velocity, spin (n, 3); motion (n) uint8: 0 driven, 1 free, 2 fixed; "
           "rotations (n) uint8: 0 or 1; the rest (n).")
      .def("set_segments", &setSegments, "id"_a, "nodes"_a,
           "id (n) int64; nodes (n, 4) int32 node indices, a triangle's fourth is -1. After set_nodes.")
      .def("add_tie", &addTie, "name"_a, "segments"_a, "slaves"_a, "formulation"_a = "default", "search"_a = "box",
           "search_distance"_a = 0.0, "drop_unresolved"_a = false, "segments, slaves: int32 indices.")
      .def("add_springs", &addSprings, "name"_a, "a"_a, "b"_a, "kind"_a, "stiffness"_a, "damping"_a,
           "rotational_stiffness"_a, "rotational_damping"_a,
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
      .def("set_settings", &setSettings, nb::kw_only(), "inertia"_a = "lumped", "reaction"_a = "loads",
           "geometry"_a = "finite", "position"_a = "integrated", "gravity"_a = std::array<double, 3>{},
           "method"_a = "central-difference", "time_step"_a = 0.0, "safety"_a = 0.9, "threads"_a = 0,
           "expose"_a = std::vector<std::string>(), "hide"_a = std::vector<std::string>(),
           "The tables [model], [integrator] and [interface].");

  nb::class_<Model>(m, "Model", "A scene searched, checked and sorted. Constant.")
      .def(nb::new_(&compileScene), "scene"_a, "Raises SceneError.")
      .def("report", &report, "What there is to tell: arrays over slaves and nodes in the model's order, findings.")
      .def(
          "resource",
          [](const Model& model, const std::string& guid) {
            const std::string bytes = writeResource(model, guid);
            return nb::bytes(bytes.data(), bytes.size());
          },
          "guid"_a, "resources/scene.bin of the FMU, as bytes.");
  nb::class_<Xml>(m, "Description", "modelDescription.xml of a model's FMU. Analysed once.")
      .def(nb::init<const Model&, std::string, std::string>(), nb::keep_alive<1, 2>(), "model"_a, "name"_a, "title"_a,
           "name: of the scene; title: free text. Raises SceneError where the model cannot start.")
      .def(
          "write",
          [](const Xml& description, const std::string& guid, nb::callable sink) {
            description.write(guid, [&](std::string_view text) { sink(nb::bytes(text.data(), text.size())); });
          },
          "guid"_a, "sink"_a, "Calls sink(bytes) with the text, piece by piece.")
      .def_prop_ro("step_size", &Xml::stepSize, "Of the default experiment, s.");
  m.def("nodal_step", nb::overload_cast<double, double>(&nodalStep), "inertia"_a, "stiffness"_a,
        "sqrt(2 m/K) or sqrt(2 I/Kr) of a node, s [theory (6.3)]; 1e30 where nothing limits it.");
  m.def("model_identifier", &modelIdentifier, "name"_a, "The C identifier that an FMU of this name uses.");

  nb::class_<Simulation::State>(m, "State", "A saved state; only for `restore` of a simulation of the same model.")
      .def_prop_ro("time", [](const Simulation::State& s) { return s.time; });

  nb::class_<Run>(m, "Simulation", "One running instance of a model, as the FMU runs it.")
      .def(nb::init<std::shared_ptr<Model>>(), "model"_a)
      .def(
          "reset", [](Run& r) { r.simulation.reset(); }, "Back to the start values, as constructed.")
      .def(
          "initialise", [](Run& r, double t) { r.simulation.initialise(t); }, "time"_a = 0.0,
          "Start time, s. Raises SceneError, e.g. for a free node without mass.")
      .def(
          "step", [](Run& r, double h) { r.simulation.step(h); }, "duration"_a,
          "Forward by `duration` s, in equal substeps within the limit. Raises Diverged.")
      .def(
          "update_outputs", [](Run& r) { r.simulation.updateOutputs(); },
          "Brings outputs in line with the inputs last set; the getters do it by themselves.")
      .def("get", &Run::get, "field"_a, "A copy of the field: (n, 3), (n, 4) or (n), rows as in Model.report().")
      .def("set", &Run::set, "field"_a, "values"_a, "Writes the whole field, of any shape with as many values.")
      .def("get_values", &Run::getValues, "names"_a, "Values of variables by their FMU names, e.g. slave[1].v[3].")
      .def("set_values", &Run::setValues, "names"_a, "values"_a, "Sets inputs and parameters by their FMU names.")
      .def("save",
           [](const Run& r) {
             Simulation::State state;
             r.simulation.save(state);
             return state;
           })
      .def(
          "restore", [](Run& r, const Simulation::State& state) { r.simulation.restore(state); }, "state"_a)
      .def_prop_ro("fields", &Run::fields, "Names of the model's fields and how many values each has.")
      .def_prop_ro("variables", &Run::variables, "The FMU's variables, as a list of blocks in value reference order.")
      .def("variable_names", &Run::variableNames, "block"_a,
           "FMU names of the block of this number in `variables`, in value reference order, e.g. slave[1].v[3].")
      .def_prop_ro("time", [](const Run& r) { return r.simulation.time(); })
      .def_prop_ro(
          "evaluations", [](const Run& r) { return r.simulation.evaluations(); }, "Force evaluations so far.")
      .def_prop_ro(
          "integrator_limit", [](const Run& r) { return r.simulation.integratorLimit(); },
          "Largest stable step of the chosen integrator, damping included, s (1e30: none).");

  bindKernels(m);
}
