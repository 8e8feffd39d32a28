// A compiled scene: what it tells of itself, and the files of an FMU.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <optional>

#include "../../fmu/resource.hpp"
#include "../../modelDescription/variables.hpp"
#include "../../modelDescription/xml.hpp"
#include "../../src/compile.hpp"
#include "../../src/inertia.hpp"
#include "../../src/lumping.hpp"
#include "../../src/port.hpp"
#include "../../src/segment.hpp"
#include "../../src/stability.hpp"
#include "bindings.hpp"
#include "convert.hpp"

namespace tiefmu {
namespace {

std::shared_ptr<Model> compileScene(const Scene& scene) {
  checkInterface(scene);
  return std::make_shared<Model>(compile(scene));
}

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

nb::object reportLumping(const Model& model) {
  const std::optional<LumpingError> found = lumpingError(model);
  if (!found || model.settings.inertia != Inertia::lumped) return nb::none();
  nb::dict d;
  d["ratio"] = found->ratio;
  d["segment"] = found->segment;
  d["connected"] = found->connected;
  return d;
}

nb::dict report(const Model& model) {
  nb::list warnings, notes, dropped;
  for (const Finding& f : model.findings) (f.kind == Finding::warning ? warnings : notes).append(f.text);
  for (const Dropped& x : model.dropped) dropped.append(nb::make_tuple(x.id, x.tie, x.reason));
  nb::dict d;
  d["slaves"] = reportSlaves(model);
  d["nodes"] = reportNodes(model);
  d["couplings"] = std::vector<std::string>(words<Coupling>.begin(), words<Coupling>.end());
  d["search_distance"] = model.searchDistance;
  d["springs"] = model.springs.size();
  d["lumping"] = reportLumping(model);
  d["ports"] = reportPorts(model);
  d["dropped"] = dropped;
  d["left_out"] = numpy(model.leftOut);
  d["warnings"] = warnings;
  d["notes"] = notes;
  return d;
}

std::pair<Array<double>, Array<double>> spreadPortLoads(const Model& model, Vectors force, Vectors moment) {
  const std::size_t ports = model.ports.size() - model.drivenPorts(), n = static_cast<std::size_t>(model.slaves());
  require(force.shape(0) == ports && moment.shape(0) == ports,
          "force, moment: one row for each of " + std::to_string(ports) + " ports of slaves");
  const Layout layout(model);
  std::vector<double> data(layout.size), fs(3 * n), ms(3 * n);
  Ports(model, layout, data.data()).distributeLoads(force.data(), moment.data(), fs.data(), ms.data());
  return {numpy<double>(std::move(fs), {n, 3}), numpy<double>(std::move(ms), {n, 3})};
}

}  // namespace

void bindModel(nb::module_& m) {
  nb::class_<Model>(m, "Model", "A scene searched, checked and sorted. Constant.")
      .def(nb::new_(&compileScene), "scene"_a, "Raises SceneError.")
      .def("report", &report, "What there is to tell: arrays over slaves and nodes in the model's order, findings.")
      .def(
          "spread_port_loads", &spreadPortLoads, "force"_a, "moment"_a,
          "Forces (N) and moments (N m) on the slaves, (slaves, 3) in the model's order, of such loads on the ports of "
          "slaves, where they are at the start: theory (3.14).")
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
          [](const Xml& description, int fmi, const std::string& guid, nb::callable sink) {
            require(fmi == 2 || fmi == 3, "fmi: 2 or 3");
            description.write(fmi == 3 ? Standard::fmi3 : Standard::fmi2, guid,
                              [&](std::string_view text) { sink(nb::bytes(text.data(), text.size())); });
          },
          "fmi"_a, "guid"_a, "sink"_a, "Calls sink(bytes) with the text, piece by piece. fmi: 2 or 3.")
      .def_prop_ro("step_size", &Xml::stepSize, "Of the default experiment, s.");
  m.def("nodal_step", nb::overload_cast<double, double>(&nodalStep), "inertia"_a, "stiffness"_a,
        "sqrt(2 m/K) or sqrt(2 I/Kr) of a node, s [theory (6.3)]; 1e30 where nothing limits it.");
  m.def("model_identifier", &modelIdentifier, "name"_a, "The C identifier that an FMU of this name uses.");
}

}  // namespace tiefmu
