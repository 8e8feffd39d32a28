// Times one cycle of the solver and the calls of the FMU. Prints CSV rows: case,n,threads,ns,bytes,triad_gb_s
// (ns per slave and cycle, per call, or per value; bytes per slave that must move, or 0).
//
//   tiefmu_bench kernels N [shuffled] [THREADS]   cycles at N slaves: loads to masters, accelerations, velocities, slave motion
//   tiefmu_bench cycles COUPLING N COUNT   that many cycles and no timing, for instruction counts
//   tiefmu_bench memory COUPLING N bytes per slave of an FMU's simulation, its model included
//   tiefmu_bench fmu FOLDER        fmi2DoStep, set and get of an unpacked FMU (FOLDER holds binaries/, resources/)
#include <dlfcn.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

extern "C" {
#include "fmi2FunctionTypes.h"
}
#include "simulation.hpp"

using namespace tiefmu;

namespace {

double now() {
  using namespace std::chrono;
  return duration<double>(steady_clock::now().time_since_epoch()).count();
}

// Best of several runs of `body`, each long enough to be measured, in seconds per call.
template <class Body>
double best(Body&& body, double enough = 0.002) {
  body();
  long calls = 1;
  double shortest = 1e30;
  for (int run = 0; run < 200;) {
    const double start = now();
    for (long k = 0; k < calls; ++k) body();
    const double taken = now() - start;
    if (taken < enough) {
      calls *= 2;
      continue;
    }
    shortest = std::min(shortest, taken / static_cast<double>(calls));
    ++run;
  }
  return shortest;
}

// a = b + s c over arrays far larger than the caches, GB/s (three arrays moved).
double triad() {
  const std::size_t n = 1u << 24;
  std::vector<double> a(n, 0.0), b(n, 1.0), c(n, 2.0);
  const double seconds = best([&] {
    for (std::size_t i = 0; i < n; ++i) a[i] = b[i] + 3.0 * c[i];
    asm volatile("" : : "r"(a.data()) : "memory");
  }, 0.01);
  return 24e-9 * static_cast<double>(n) / seconds;
}

// A surface of side x side quads with four slaves each, free masters without springs: every cycle moves everything.
Scene surface(const std::string& coupling, int slaves, bool shuffled, int threads) {
  Scene scene;
  const int side = std::max(1, static_cast<int>(std::lround(std::sqrt(slaves / 4.0))));
  const auto add = [&](const Vec3& x, Motion motion) {
    SceneNodes& n = scene.nodes;
    n.id.push_back(static_cast<std::int64_t>(n.id.size()) + 1);
    n.position.push_back(x);
    n.motion.push_back(motion);
    n.rotations.push_back(coupling == "default-rotations");
    n.mass.push_back(1.0);
    n.inertia.push_back(coupling == "default-rotations" || coupling == "optimized" ? 0.1 : 0.0);
    n.stiffness.push_back(0);
    n.rotationalStiffness.push_back(0);
    n.velocity.push_back(Vec3(0.1, 0.2, 0.3));
    n.spin.push_back(Vec3(0.1, 0.2, 0.3));
    return static_cast<int>(n.id.size()) - 1;
  };
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) add(Vec3(i, j, 0.1 * ((i + j) % 2)), Motion::free);
  SceneTie tie;
  tie.name = "surface";
  tie.formulation = coupling == "optimized" ? Formulation::optimized : Formulation::standard;
  const double offset = coupling == "default" ? 0.0 : 0.3;
  std::vector<Vec3> places;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const int a = j * (side + 1) + i;
      tie.segments.push_back(static_cast<int>(scene.segments.id.size()));
      scene.segments.id.push_back(static_cast<std::int64_t>(scene.segments.id.size()) + 1);
      scene.segments.nodes.push_back({a, a + 1, a + side + 2, a + side + 1});
      for (int k = 0; k < 4; ++k) places.push_back(Vec3(i + 0.3 + 0.4 * (k % 2), j + 0.3 + 0.4 * (k / 2), 0.05 + offset));
    }
  if (shuffled) {
    std::uint64_t seed = 1;
    for (std::size_t k = places.size(); k-- > 1;) {
      seed = seed * 6364136223846793005u + 1442695040888963407u;
      std::swap(places[k], places[(seed >> 33) % (k + 1)]);
    }
  }
  for (const Vec3& x : places) tie.slaves.push_back(add(x, Motion::driven));
  scene.ties.push_back(tie);
  scene.settings.timeStep = 1e-6;
  scene.settings.threads = threads;
  return scene;
}

// Bytes per slave and cycle that must move between memory and core when nothing stays in the caches: each array once
// per pass over it, masters spread over the four slaves of a quad.
double bytesMoved(const std::string& coupling) {
  // Loads pass: F (24), Phi (32); motion pass: Phi (32), v_s (24 written).
  // Masters, one per four slaves: indices twice (32), v three times with its kick (96), f (48), f_ext (24), a (96), mass (16).
  double slave = 24 + 32 + 32 + 24, master = 32 + 96 + 48 + 24 + 96 + 16;
  if (coupling == "default-rotations") {
    // M (24), d read three times and written (96), w_s (24), 1/d0^2 (8), Phi once more; masters: the same for rotation.
    slave += 24 + 96 + 24 + 8 + 32;
    master += 96 + 48 + 24 + 96 + 16;
  } else if (coupling == "optimized") {
    // No Phi; M (24), d0 (24), d written and read twice (72), w_s (24); masters: x (48), frames (168 thrice), quaternion (64).
    slave += 24 + 24 + 72 + 24 - 64;
    master += 48 + 504 + 64 + 32;
  }
  return slave + master / 4;
}

// One simulation under its own loads, ready to cycle.
struct Cycle {
  Simulation simulation;
  Cycle(const std::string& coupling, int slaves, bool shuffled, int threads)
      : simulation(std::make_shared<Model>(compile(surface(coupling, slaves, shuffled, threads)))) {
    const std::size_t forces = simulation.layout()[Field::slaveForce].count;
    for (std::size_t k = 0; k < forces; ++k) simulation.field(Field::slaveForce)[k] = 1e-3 * static_cast<double>(k % 7);
    simulation.initialise(0);
  }
  void operator()() {
    simulation.step(1e-6);
    simulation.updateOutputs();
  }
};

void kernels(int slaves, bool shuffled, int threads) {
  const double gbs = triad();
  for (const std::string coupling : {"default", "default-rotations", "optimized"}) {
    Cycle cycle(coupling, slaves, shuffled, threads);
    const double seconds = best(cycle);
    const int n = cycle.simulation.model().slaves();
    std::printf("%s%s,%d,%d,%.2f,%.0f,%.2f\n", coupling.c_str(), shuffled ? "-shuffled" : "", n, threads, 1e9 * seconds / n,
                bytesMoved(coupling), gbs);
    std::fflush(stdout);
  }
}

void memory(const std::string& coupling, int slaves) {
  const auto used = [] {
    const struct mallinfo2 info = mallinfo2();
    return static_cast<double>(info.uordblks + info.hblkhd);
  };
  const double before = used();
  auto model = std::make_shared<Model>(compile(surface(coupling, slaves, false, 1)));
  model->slaveReport = std::vector<SlaveReport>();  // an FMU's resource leaves it out
  const double compiled = used();
  Simulation simulation(model);
  simulation.initialise(0);
  simulation.step(1e-6);
  const int n = model->slaves();
  std::printf("memory-%s,%d,1,0,%.0f,0\n", coupling.c_str(), n, (used() - before) / n);
  std::fprintf(stderr, "%s: model %.0f, simulation %.0f bytes per slave\n", coupling.c_str(), (compiled - before) / n,
               (used() - compiled) / n);
}

void logMessage(void*, const char*, fmi2Status, const char*, const char* message, ...) {
  std::fprintf(stderr, "%s\n", message);
}

void fmu(const std::string& folder) {
  std::string binary;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder + "/binaries"))
    if (entry.is_regular_file()) binary = entry.path();
  void* library = dlopen(binary.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library) {
    std::fprintf(stderr, "%s\n", dlerror());
    std::exit(1);
  }
#define TIEFMU_CALL(name) const auto name = reinterpret_cast<name##TYPE*>(dlsym(library, #name))
  TIEFMU_CALL(fmi2Instantiate);
  TIEFMU_CALL(fmi2SetupExperiment);
  TIEFMU_CALL(fmi2EnterInitializationMode);
  TIEFMU_CALL(fmi2ExitInitializationMode);
  TIEFMU_CALL(fmi2DoStep);
  TIEFMU_CALL(fmi2SetReal);
  TIEFMU_CALL(fmi2GetReal);
  TIEFMU_CALL(fmi2FreeInstance);
#undef TIEFMU_CALL
  std::ifstream file(folder + "/modelDescription.xml");
  const std::string xml((std::istreambuf_iterator<char>(file)), {});
  const std::size_t at = xml.find("guid=\"") + 6;
  const std::string guid = xml.substr(at, xml.find('"', at) - at);
  const fmi2CallbackFunctions callbacks = {logMessage, std::calloc, std::free, nullptr, nullptr};
  fmi2Component c = fmi2Instantiate("bench", fmi2CoSimulation, guid.c_str(), ("file://" + folder + "/resources").c_str(),
                                    &callbacks, fmi2False, fmi2False);
  if (!c) std::exit(1);
  // References of the slaves' forces and velocities, in the order of the file.
  std::vector<fmi2ValueReference> inputs, outputs;
  for (std::size_t p = xml.find("<ScalarVariable "); p != std::string::npos; p = xml.find("<ScalarVariable ", p + 1)) {
    const std::string head = xml.substr(p, xml.find('>', p) - p);
    const std::size_t r = head.find("valueReference=\"");
    const auto reference = static_cast<fmi2ValueReference>(std::strtoul(head.c_str() + r + 16, nullptr, 10));
    if (head.find("name=\"slave[") == std::string::npos) continue;
    if (head.find("].f[") != std::string::npos) inputs.push_back(reference);
    if (head.find("].v[") != std::string::npos) outputs.push_back(reference);
  }
  std::sort(inputs.begin(), inputs.end());
  std::sort(outputs.begin(), outputs.end());
  fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0);
  fmi2EnterInitializationMode(c);
  fmi2ExitInitializationMode(c);
  const int n = static_cast<int>(inputs.size() / 3);
  if (n == 1) {
    double t = 0;
    const double h = 1e-6, seconds = best([&] {
      if (fmi2DoStep(c, t, h, fmi2True) != fmi2OK) std::exit(1);
      t += h;
    });
    std::printf("dostep-one-slave,1,1,%.2f,0,0\n", 1e9 * seconds);
  } else {
    std::vector<double> values(inputs.size(), 1.0);
    const double set = best([&] { fmi2SetReal(c, inputs.data(), inputs.size(), values.data()); });
    std::printf("set-real,%zu,1,%.3f,8,0\n", inputs.size(), 1e9 * set / static_cast<double>(inputs.size()));
    const double get = best([&] { fmi2GetReal(c, outputs.data(), outputs.size(), values.data()); });
    std::printf("get-real,%zu,1,%.3f,8,0\n", outputs.size(), 1e9 * get / static_cast<double>(outputs.size()));
    std::uint64_t seed = 1;
    for (std::size_t k = outputs.size(); k-- > 1;) {
      seed = seed * 6364136223846793005u + 1442695040888963407u;
      std::swap(outputs[k], outputs[(seed >> 33) % (k + 1)]);
    }
    const double scattered = best([&] { fmi2GetReal(c, outputs.data(), outputs.size(), values.data()); });
    std::printf("get-real-scattered,%zu,1,%.3f,8,0\n", outputs.size(), 1e9 * scattered / static_cast<double>(outputs.size()));
  }
  fmi2FreeInstance(c);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "kernels" && argc > 2) {
    bool shuffled = false;
    int threads = 1;
    for (int k = 3; k < argc; ++k) {
      if (!std::strcmp(argv[k], "shuffled")) shuffled = true;
      else threads = std::atoi(argv[k]);
    }
    kernels(std::atoi(argv[2]), shuffled, threads);
  }
  else if (what == "cycles" && argc > 4) {
    Cycle cycle(argv[2], std::atoi(argv[3]), false, 1);
    for (int k = std::atoi(argv[4]); k > 0; --k) cycle();
  } else if (what == "memory" && argc > 3) memory(argv[2], std::atoi(argv[3]));
  else if (what == "fmu" && argc > 2) fmu(argv[2]);
  else {
    std::fprintf(stderr, "usage: tiefmu_bench kernels N [shuffled] [THREADS] | cycles COUPLING N COUNT | memory COUPLING N | fmu FOLDER\n");
    return 2;
  }
}
