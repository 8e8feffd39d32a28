// Times one cycle of the solver and what stands round it. Prints CSV rows: case,n,threads,value,unit,bytes,triad_gb_s
// (bytes per slave and cycle that must move, and the GB/s that a triad moves; or 0).
//
//   tiefmu_bench kernels CASE N [shuffled] [THREADS]   cycles at N slaves: loads to masters, accelerations, velocities,
//                                  slave motion. CASE: default, default-rotations or optimized, then in this order
//                                  -welds1, -welds4 (quads apart from each other with so many slaves; else a surface
//                                  of quads with four each), -light (slaves a quarter as heavy), -flipped (the loads
//                                  on the masters change sign before every step), -long (a hundred substeps a step),
//                                  -consistent
//   tiefmu_bench cycles CASE N COUNT   that many cycles and no timing, for instruction counts
//   tiefmu_bench memory CASE N     bytes per slave of an FMU's simulation, its model included
//   tiefmu_bench search N [shuffled]   both searches of N slaves on N/4 segments
//   tiefmu_bench fmu FOLDER NOTHING   calls of an unpacked FMU (FOLDER holds binaries/, resources/), beside those of
//                                  the library NOTHING, which does nothing
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "compile.hpp"
#include "search.hpp"
#include "simulation.hpp"
#include "timing.hpp"

using namespace tiefmu;
using bench::best, bench::row;

namespace {

// a = b + s c over arrays far larger than the caches, GB/s (three arrays moved).
double triad() {
  const std::size_t n = 1u << 24;
  std::vector<double> a(n, 0.0), b(n, 1.0), c(n, 2.0);
  const double seconds = best([&] {
    for (std::size_t i = 0; i < n; ++i) a[i] = b[i] + 3.0 * c[i];
    asm volatile("" : : "r"(a.data()) : "memory");
  });
  return 24e-9 * static_cast<double>(n) / seconds;
}

// What is computed: a formulation ("default", "default-rotations", "optimized"), with lumped or consistent inertia.
struct Case {
  std::string name, coupling;
  bool consistent, flipped, light;
  int substeps = 1;  // of a step
  int welds = 0;     // slaves of each quad that stands apart; 0: a surface
  bool take(const char* ending) {
    if (!coupling.ends_with(ending)) return false;
    coupling.resize(coupling.size() - std::strlen(ending));
    return true;
  }
  explicit Case(const std::string& text) : name(text), coupling(text) {
    consistent = take("-consistent");
    if (take("-long")) substeps = 100;
    flipped = take("-flipped");
    light = take("-light");
    welds = take("-welds1") ? 1 : take("-welds4") ? 4 : 0;
    if (coupling == "default" || coupling == "default-rotations" || coupling == "optimized") return;
    std::fprintf(stderr, "unknown case '%s'\n", text.c_str());
    std::exit(2);
  }
};

// A surface of side x side quads with four slaves each (fewer than four: one quad), free masters without springs: every
// cycle moves everything.
Scene surface(const Case& what, int slaves, bool shuffled, int threads = 1) {
  Scene scene;
  const int each = what.welds ? what.welds : std::min(4, slaves);
  const int side = std::max(1, static_cast<int>(std::lround(std::sqrt(slaves / (what.welds ? each : 4.0)))));
  const auto add = [&](const Vec3& x, Motion motion, double mass = 1) {
    SceneNodes& n = scene.nodes;
    n.id.push_back(static_cast<std::int64_t>(n.id.size()) + 1);
    n.position.push_back(x);
    n.motion.push_back(motion);
    n.rotations.push_back(what.coupling == "default-rotations");
    n.mass.push_back(mass);
    n.inertia.push_back(what.coupling == "default" ? 0.0 : 0.1 * mass);
    n.stiffness.push_back(0);
    n.rotationalStiffness.push_back(0);
    n.velocity.push_back(Vec3(0.1, 0.2, 0.3));
    n.spin.push_back(Vec3(0.1, 0.2, 0.3));
    return static_cast<int>(n.id.size()) - 1;
  };
  const auto corner = [&](int i, int j) { return Vec3(i, j, 0.1 * ((i + j) % 2)); };
  if (!what.welds)
    for (int j = 0; j <= side; ++j)
      for (int i = 0; i <= side; ++i) add(corner(i, j), Motion::free);
  SceneTie tie;
  tie.name = "surface";
  tie.formulation = what.coupling == "optimized" ? Formulation::optimized : Formulation::standard;
  const double offset = what.coupling == "default" ? 0.0 : 0.3;
  std::vector<Vec3> places;
  int quads = what.welds ? std::max(1, slaves / each) : side * side;
  for (int j = 0; quads > 0; ++j)
    for (int i = 0; i < side && quads > 0; ++i, --quads) {
      const int a = j * (side + 1) + i;
      tie.segments.push_back(static_cast<int>(scene.segments.id.size()));
      scene.segments.id.push_back(static_cast<std::int64_t>(scene.segments.id.size()) + 1);
      if (what.welds) {
        const int b = add(corner(i, j), Motion::free);
        add(corner(i + 1, j), Motion::free);
        add(corner(i + 1, j + 1), Motion::free);
        add(corner(i, j + 1), Motion::free);
        scene.segments.nodes.push_back({b, b + 1, b + 2, b + 3});
      } else {
        scene.segments.nodes.push_back({a, a + 1, a + side + 2, a + side + 1});
      }
      for (int k = 0; k < each; ++k)
        places.push_back(Vec3(i + 0.3 + 0.4 * (k % 2), j + 0.3 + 0.4 * (k / 2), 0.05 + offset));
    }
  if (shuffled) bench::shuffle(places);
  for (const Vec3& x : places) tie.slaves.push_back(add(x, Motion::driven, what.light ? 0.25 : 1));
  scene.ties.push_back(tie);
  scene.settings.timeStep = 1e-6;
  scene.settings.safety = 0.9;
  scene.settings.solverTolerance = 1e-4;
  scene.settings.threads = threads;
  if (what.consistent) scene.settings.inertia = Inertia::consistent;
  return scene;
}

// Bytes per slave and cycle that must move between memory and core when nothing stays in the caches: each array once
// per pass over it, masters spread over the four slaves of a quad. 0 for consistent inertia, which iterates.
double bytesMoved(const Case& what) {
  if (what.consistent || what.welds) return 0;
  // Loads pass: F (24), Phi (32); motion pass: Phi (32), v_s (24 written).
  // Masters, one per four slaves: indices twice (32), v three times with its kick (96), f (48), f_ext (24), a (96),
  // mass (16).
  double slave = 24 + 32 + 32 + 24, master = 32 + 96 + 48 + 24 + 96 + 16;
  if (what.coupling == "default-rotations") {
    // M (24), d read three times and written (96), w_s (24), 1/d0^2 (8), Phi once more; masters: the same for rotation.
    slave += 24 + 96 + 24 + 8 + 32;
    master += 96 + 48 + 24 + 96 + 16;
  } else if (what.coupling == "optimized") {
    // No Phi; M (24), d0 (24), d written and read twice (72), w_s (24); masters: x (48), frames (192 written, 168 read
    // twice), quaternion (64).
    slave += 24 + 24 + 72 + 24 - 64;
    master += 48 + 528 + 64 + 32;
  }
  return slave + master / 4;
}

// One simulation under its own loads, ready to cycle. Flipped loads are inputs that change before every step, which
// then evaluates twice.
class Cycle {
 public:
  Cycle(const Case& what, int slaves, bool shuffled, int threads)
      : simulation_(std::make_shared<Model>(compile(surface(what, slaves, shuffled, threads)))) {
    const std::size_t slaveForces = simulation_.layout()[Field::slaveForce].count;
    const std::size_t nodeForces = simulation_.layout()[Field::nodeForce].count;
    for (std::size_t k = 0; k < slaveForces; ++k)
      simulation_.field(Field::slaveForce)[k] = 1e-3 * static_cast<double>(k % 7);
    for (std::size_t k = 0; k < nodeForces; ++k)
      simulation_.field(Field::nodeForce)[k] = 1e-4 * static_cast<double>(k % 5);
    if (what.flipped) flipped_ = nodeForces;
    duration_ = 1e-6 * what.substeps;
    simulation_.initialise(0);
  }
  int slaves() const { return simulation_.model().slaves(); }
  void operator()() {
    if (flipped_ > 0) {
      double* force = simulation_.field(Field::nodeForce);
      for (std::size_t k = 0; k < flipped_; ++k) force[k] = -force[k];
      simulation_.inputsChanged();
    }
    simulation_.step(duration_);
    simulation_.updateOutputs();
  }

 private:
  Simulation simulation_;
  std::size_t flipped_ = 0;
  double duration_;
};

void kernels(const Case& what, int slaves, bool shuffled, int threads) {
  const double gbs = triad();
  Cycle cycle(what, slaves, shuffled, threads);
  const double seconds = best(cycle);
  row((what.name + (shuffled ? "-shuffled" : "")).c_str(), static_cast<std::size_t>(cycle.slaves()), threads,
      1e9 * seconds / (cycle.slaves() * what.substeps), "ns per slave and cycle", bytesMoved(what), gbs);
}

void memory(const Case& what, int slaves) {
  const auto used = [] {
    const struct mallinfo2 info = mallinfo2();
    return static_cast<double>(info.uordblks + info.hblkhd);
  };
  const double before = used();
  auto model = std::make_shared<Model>(compile(surface(what, slaves, false)));
  model->slaveReport = std::vector<SlaveReport>();  // an FMU's resource leaves it out
  const double compiled = used();
  Simulation simulation(model);
  simulation.initialise(0);
  simulation.step(1e-6);
  const int n = model->slaves();
  row(("memory-" + what.name).c_str(), static_cast<std::size_t>(n), 1, (used() - before) / n, "bytes per slave");
  std::fprintf(stderr, "%s: model %.0f, simulation %.0f bytes per slave\n", what.name.c_str(), (compiled - before) / n,
               (used() - compiled) / n);
}

void search(int slaves, bool shuffled) {
  const Scene scene = surface(Case("default-rotations"), slaves, shuffled);
  const std::vector<int>& wanted = scene.ties[0].slaves;
  for (const SearchMethod method : {SearchMethod::box, SearchMethod::nearestNode}) {
    std::size_t found = 0;
    const double seconds = best(
        [&] {
          found = 0;
          const SegmentSearch search(scene.nodes.position, scene.segments.nodes, scene.segments.id);
          std::vector<Vec3> places;  // as bindSlaves does it
          for (int k : wanted) places.push_back(scene.nodes.position[k]);
          search.each(method, places, search.defaultReach(method),
                      [&](int, const Match& match) { found += match.segment >= 0; });
        },
        2);
    if (found != wanted.size()) std::exit(1);
    const std::string name = method == SearchMethod::box ? "search-box" : "search-nearest-node";
    row((name + (shuffled ? "-shuffled" : "")).c_str(), found, 1, seconds, "s");
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "kernels" && argc > 3) {
    const bool shuffled = argc > 4 && !std::strcmp(argv[4], "shuffled");
    const int last = shuffled ? 5 : 4;
    kernels(Case(argv[2]), std::atoi(argv[3]), shuffled, argc > last ? std::atoi(argv[last]) : 1);
  } else if (what == "cycles" && argc > 4) {
    Cycle cycle(Case(argv[2]), std::atoi(argv[3]), false, 1);
    for (int k = std::atoi(argv[4]); k > 0; --k) cycle();
  } else if (what == "memory" && argc > 3)
    memory(Case(argv[2]), std::atoi(argv[3]));
  else if (what == "search" && argc > 2)
    search(std::atoi(argv[2]), argc > 3 && !std::strcmp(argv[3], "shuffled"));
  else if (what == "fmu" && argc > 3)
    bench::fmu(argv[2], argv[3]);
  else {
    std::fprintf(stderr,
                 "usage: tiefmu_bench kernels CASE N [shuffled] [THREADS] | cycles CASE N COUNT | "
                 "memory CASE N | search N [shuffled] | fmu FOLDER NOTHING\n");
    return 2;
  }
}
