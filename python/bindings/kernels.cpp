// The solver's kernels for tests and studies: NumPy arrays in, NumPy arrays out.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <utility>

#include "../../src/inertia.hpp"
#include "../../src/search.hpp"
#include "../../src/stability.hpp"
#include "../../src/tie.hpp"
#include "bindings.hpp"
#include "convert.hpp"

namespace tiefmu {
namespace {

using Ints = nb::ndarray<const int, nb::c_contig, nb::device::cpu>;

int cornersOf(const Values& corners, Vec3* x) {
  const std::size_t n = corners.ndim() == 2 && corners.shape(1) == 3 ? corners.shape(0) : 0;
  if (n != 3 && n != 4) throw nb::value_error("corners must be of shape (3, 3) or (4, 3)");
  for (std::size_t i = 0; i < n; ++i) x[i] = at(corners.data(), static_cast<Eigen::Index>(i));
  return static_cast<int>(n);
}

void wants(const Values& a, std::size_t size, const char* what) {
  if (a.size() != size)
    throw nb::value_error(
        (std::string(what) + " has " + std::to_string(a.size()) + " entries, not " + std::to_string(size)).c_str());
}

// Slaves of one coupling on segments of one shape, outside any scene.
struct Group {
  TieGroup tie;
  std::size_t nodes, slaves;
  std::vector<SegmentFrame> frames;
  std::vector<double> offset;

  TieGeometry geometry() const { return {offset.data(), frames.data()}; }
  SegmentRange all() const { return {0, tie.segments()}; }
};

}  // namespace

void bindKernels(nb::module_& parent) {
  nb::module_ m = parent.def_submodule("kernels", "Kernels of the tie on NumPy arrays (SI units).");

  m.def("use_baseline", &useBaselineKernels, "baseline"_a,
        "Kernels of the baseline instruction set (True) or the best that this machine has, for the whole process. "
        "Returns "
        "whether they are the baseline's now.");

  m.def(
      "sine_cosine",
      [](double angle) {
        const SineCosine of = sineCosine(angle);
        return std::pair(of.sine, of.cosine);
      },
      "angle"_a, "Of an angle, rad.");
  m.def(
      "angle_of", [](double y, double x) { return angleOf(y, x); }, "y"_a, "x"_a,
      "Angle of the point (x, y), neither negative, in [0, pi/2] rad.");

  m.def(
      "shape",
      [](int n, double xi, double eta) {
        if (n != 3 && n != 4) throw nb::value_error("n is 3 or 4");
        const Phi phi = shape(n, xi, eta);
        return numpy<double>({phi.begin(), phi.begin() + n}, {static_cast<std::size_t>(n)});
      },
      "n"_a, "xi"_a, "eta"_a, "Shape functions Phi of a quad (n = 4) or triangle (3), shape (n,).");

  m.def(
      "project",
      [](Values corners, Values points) {
        Vec3 x[4];
        const int n = cornersOf(corners, x);
        const std::size_t count = points.size() / 3;
        std::vector<double> local, phi, clamp, distance, outside, nearest;
        std::vector<std::uint8_t> converged, folded;
        for (std::size_t s = 0; s < count; ++s) {
          const Projection p = project(n, x, at(points.data(), static_cast<Eigen::Index>(s)));
          const Phi inside = clamped(n, p.phi.data());
          local.insert(local.end(), {p.xi, p.eta});
          phi.insert(phi.end(), p.phi.begin(), p.phi.begin() + n);
          clamp.insert(clamp.end(), inside.begin(), inside.begin() + n);
          distance.push_back(p.distance);
          outside.push_back(p.outside);
          nearest.push_back(p.nearest);
          converged.push_back(p.converged);
          folded.push_back(p.folded);
        }
        nb::dict d;
        d["local"] = numpy<double>(std::move(local), {count, 2});
        d["phi"] = numpy<double>(std::move(phi), {count, static_cast<std::size_t>(n)});
        d["clamped"] = numpy<double>(std::move(clamp), {count, static_cast<std::size_t>(n)});
        d["distance"] = numpy<double>(std::move(distance), {count});
        d["outside"] = numpy<double>(std::move(outside), {count});
        d["nearest"] = numpy<double>(std::move(nearest), {count});
        d["converged"] = numpy(std::move(converged));
        d["folded"] = numpy(std::move(folded));
        return d;
      },
      "corners"_a, "points"_a,
      "Closest points of a segment (corners (n, 3), m) to points (m, 3): local (m, 2), phi and clamped (m, n), "
      "distance (m,) to the projection, outside (m,), nearest (m,): distance to the closest point of the segment, "
      "converged (m,): a projection within 1.5 is known, folded (m,): the surface lies over itself there.");

  m.def(
      "node_inertia",
      [](Values corners) {
        Vec3 x[4];
        const NodeInertia inertia = nodeInertia(cornersOf(corners, x), x);
        nb::dict d;
        d["centre"] = numpy<double>({inertia.centre.begin(), inertia.centre.end()}, {3});
        std::vector<double> matrix(inertia.ibar.data(), inertia.ibar.data() + 9);
        d["ibar"] = numpy<double>(std::move(matrix), {3, 3});
        d["lambda"] = inertia.lambda;
        d["condition"] = inertia.condition;
        return d;
      },
      "corners"_a, "Centre (m), Ibar (m2), lambda (1/m2) and cond(Ibar) of a segment's nodes.");

  m.def(
      "search",
      [](Values positions, Ints segments, Values slaves, const std::string& method, double distance) {
        if (segments.ndim() != 2 || segments.shape(1) != 4) throw nb::value_error("segments must be of shape (m, 4)");
        std::vector<Vec3> x;
        for (std::size_t i = 0; i < positions.size() / 3; ++i)
          x.emplace_back(at(positions.data(), static_cast<Eigen::Index>(i)));
        std::vector<std::array<int, 4>> nodes(segments.shape(0));
        std::vector<std::int64_t> ids;
        for (std::size_t e = 0; e < nodes.size(); ++e) {
          std::copy_n(segments.data() + 4 * e, 4, nodes[e].begin());
          for (int k = 0; k < 4; ++k)
            if (nodes[e][k] >= static_cast<int>(x.size()) || (k < 3 && nodes[e][k] < 0))
              throw nb::value_error("node index out of range");
          ids.push_back(static_cast<std::int64_t>(e) + 1);
        }
        const SearchMethod by = fromWord<SearchMethod>(method);
        const SegmentSearch search(x, std::move(nodes), std::move(ids));
        if (!(distance > 0)) distance = search.defaultReach(by);
        const std::size_t count = slaves.size() / 3;
        std::vector<Vec3> places;
        for (std::size_t s = 0; s < count; ++s) places.emplace_back(at(slaves.data(), static_cast<Eigen::Index>(s)));
        std::vector<int> segment(count), rival(count);
        std::vector<double> gap(count), local(2 * count);
        search.each(by, places, distance, [&](int s, const Match& match) {
          segment[s] = match.segment;
          rival[s] = match.rival;
          gap[s] = match.projection.nearest;
          local[2 * s] = match.projection.xi;
          local[2 * s + 1] = match.projection.eta;
        });
        nb::dict d;
        d["segment"] = numpy(std::move(segment));
        d["distance"] = numpy<double>(std::move(gap), {count});
        d["local"] = numpy<double>(std::move(local), {count, 2});
        d["search_distance"] = distance;
        d["rival"] = numpy(std::move(rival));
        d["crossing"] = numpy(std::vector<int>(search.crossing()));
        d["zero_area"] = numpy(std::vector<int>(search.zeroArea()));
        return d;
      },
      "positions"_a, "segments"_a, "slaves"_a, "method"_a = "box", "distance"_a = 0.0,
      "Segment index (-1: none), distance to it (m), local coordinates and rival (a segment as near on another side, "
      "or "
      "-1) per slave. segments: (m, 4) node indices, -1 as the fourth of a triangle; ids are index + 1. method 'box' "
      "or "
      "'nearest-node'.");

  nb::class_<Group>(m, "Group", "Slaves tied to segments of one shape by one coupling, outside any scene.")
      .def(
          "__init__",
          [](Group* self, const std::string& coupling, Ints nodes, Ints begin, Values weight, std::size_t nodeCount) {
            if (nodes.ndim() != 2 || (nodes.shape(1) != 3 && nodes.shape(1) != 4))
              throw nb::value_error("nodes must be of shape (m, 3) or (m, 4)");
            Group g;
            g.nodes = nodeCount;
            g.tie.coupling = fromWord<Coupling>(coupling);
            g.tie.corners = static_cast<int>(nodes.shape(1));
            g.tie.firstSlave = 0;
            g.tie.node.assign(nodes.data(), nodes.data() + nodes.size());
            for (int node : g.tie.node)
              if (node < 0 || node >= static_cast<int>(nodeCount)) throw nb::value_error("node index out of range");
            g.tie.begin.assign(begin.data(), begin.data() + begin.size());
            if (g.tie.begin.size() != nodes.shape(0) + 1 || g.tie.begin.front() != 0 ||
                !std::is_sorted(g.tie.begin.begin(), g.tie.begin.end()))
              throw nb::value_error("begin must ascend from 0 and have one entry more than nodes has rows");
            g.slaves = static_cast<std::size_t>(g.tie.begin.back());
            wants(weight, g.slaves * g.tie.corners, "weight");
            g.tie.weight.assign(weight.data(), weight.data() + weight.size());
            g.frames.resize(g.tie.segments());
            g.offset.resize(3 * g.slaves);
            new (self) Group(std::move(g));
          },
          "coupling"_a, "nodes"_a, "begin"_a, "weight"_a, "node_count"_a,
          "coupling 'translation', 'rotation' or 'mean-motion'; nodes (segments, n); begin (segments + 1): first slave "
          "of "
          "each segment; weight (slaves, n): Phi.")
      .def(
          "set_geometry",
          [](Group& g, Values positions, Values offset) {
            wants(positions, 3 * g.nodes, "positions");
            wants(offset, 3 * g.slaves, "offset");
            std::copy_n(offset.data(), offset.size(), g.offset.begin());
            if (kinematicsOf(g.tie.coupling).segmentsTurn)
              updateFrames(g.tie, g.all(), positions.data(), g.frames.data());
          },
          "positions"_a, "offset"_a, "Node positions (nodes, 3) and offsets d (slaves, 3), m.")
      .def(
          "map_motion",
          [](const Group& g, Values v, Values w) {
            wants(v, 3 * g.nodes, "v");
            wants(w, 3 * g.nodes, "w");
            std::vector<double> vs(3 * g.slaves), ws(3 * g.slaves);
            mapMotion(g.tie, g.all(), g.geometry(), v.data(), w.data(), vs.data(), ws.data());
            return std::pair{numpy<double>(std::move(vs), {g.slaves, 3}), numpy<double>(std::move(ws), {g.slaves, 3})};
          },
          "v"_a, "w"_a, "(v_s, w_s) = T (v, w); (nodes, 3) to (slaves, 3). w_s is zero for 'translation'.")
      .def(
          "distribute_loads",
          [](const Group& g, Values force, Values moment) {
            wants(force, 3 * g.slaves, "force");
            wants(moment, 3 * g.slaves, "moment");
            std::vector<double> f(3 * g.nodes), t(3 * g.nodes);
            distributeLoads(g.tie, g.all(), g.geometry(), force.data(), moment.data(), f.data(), t.data());
            return std::pair{numpy<double>(std::move(f), {g.nodes, 3}), numpy<double>(std::move(t), {g.nodes, 3})};
          },
          "force"_a, "moment"_a, "(f, t) = T^T (F, M); (slaves, 3) to (nodes, 3).")
      .def(
          "bias",
          [](const Group& g, Values v, Values w) {
            wants(v, 3 * g.nodes, "v");
            wants(w, 3 * g.nodes, "w");
            std::vector<double> as(3 * g.slaves), zs(3 * g.slaves);
            addBias(g.tie, g.all(), g.geometry(), v.data(), w.data(), as.data(), zs.data());
            return std::pair{numpy<double>(std::move(as), {g.slaves, 3}), numpy<double>(std::move(zs), {g.slaves, 3})};
          },
          "v"_a, "w"_a, "The part of the slaves' accelerations that is quadratic in velocities, (slaves, 3).")
      .def(
          "lumped",
          [](const Group& g, Values positions, Values mass, Values inertia) {
            wants(positions, 3 * g.nodes, "positions");
            wants(mass, g.slaves, "mass");
            wants(inertia, g.slaves, "inertia");
            Model model;
            for (int k = 1; k <= nodeGroups; ++k) model.begin[k] = static_cast<int>(g.nodes);
            model.groups.push_back(g.tie);
            model.slaveId.resize(g.slaves);
            model.turningSlaves = kinematicsOf(g.tie.coupling).slavesTurn ? static_cast<int>(g.slaves) : 0;
            model.slaveOffset = g.offset;
            model.nodePosition.assign(positions.data(), positions.data() + positions.size());
            std::vector<double> added(g.nodes), addedInertia(g.nodes);
            lumpedAdditions(model, mass.data(), inertia.data(), added.data(), addedInertia.data());
            return std::pair{numpy(std::move(added)), numpy(std::move(addedInertia))};
          },
          "positions"_a, "mass"_a, "inertia"_a, "D: mass (kg) and inertia (kg m2) added per node.");

  m.def(
      "stable_step",
      [](const std::string& method, double omega, double c) { return stableStep(fromWord<Method>(method), omega, c); },
      "method"_a, "omega"_a, "c"_a = 0.0, "Largest stable step (s) on x'' = -omega^2 x - c x'.");
  m.def("damper_prediction", &damperPrediction, "h"_a, "omega"_a, "c"_a,
        "beta in [0, 1] of the velocity v_(n-1/2) + beta h/2 a_(n-1) of the dampers in a central difference step.");
}

}  // namespace tiefmu
