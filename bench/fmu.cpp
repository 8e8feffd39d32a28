// Times the calls of an FMU beside those of one that does nothing.
#include <dlfcn.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

extern "C" {
#include "fmi2FunctionTypes.h"
}
#include "timing.hpp"

namespace {

using bench::best, bench::now, bench::row;
using References = std::vector<fmi2ValueReference>;

void logMessage(void*, const char*, fmi2Status, const char*, const char* message, ...) {
  va_list arguments;
  va_start(arguments, message);
  std::vfprintf(stderr, message, arguments);
  va_end(arguments);
  std::fputc('\n', stderr);
}

[[noreturn]] void fail(const char* what) {
  std::fprintf(stderr, "%s\n", what);
  std::exit(1);
}

void check(fmi2Status status) {
  if (status != fmi2OK) fail("a call of the FMU did not answer fmi2OK");
}

class Library {
 public:
  explicit Library(const std::string& path) : handle_(dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (!handle_) fail(dlerror());
  }
  template <class Function> Function* function(const char* name) const {
    return reinterpret_cast<Function*>(dlsym(handle_, name));
  }

 private:
  void* handle_;
};

std::string binary(const std::string& folder) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder + "/binaries"))
    if (entry.is_regular_file()) return entry.path();
  fail("no binary in the FMU");
}

#define TIEFMU_CALL(library, name) const auto name = (library).function<name##TYPE>(#name)

// References of the slaves' forces (in) and velocities (out), in the order of memory.
struct Slaves {
  References forces, velocities;
  std::string guid;
  explicit Slaves(const std::string& folder) {
    std::ifstream file(folder + "/modelDescription.xml");
    const std::string xml((std::istreambuf_iterator<char>(file)), {});
    const std::size_t at = xml.find("guid=\"") + 6;
    guid = xml.substr(at, xml.find('"', at) - at);
    for (std::size_t p = xml.find("<ScalarVariable "); p != std::string::npos;
         p = xml.find("<ScalarVariable ", p + 1)) {
      const std::string head = xml.substr(p, xml.find('>', p) - p);
      const std::size_t r = head.find("valueReference=\"");
      const auto reference = static_cast<fmi2ValueReference>(std::strtoul(head.c_str() + r + 16, nullptr, 10));
      if (head.find("name=\"slave[") == std::string::npos) continue;
      if (head.find("].f[") != std::string::npos) forces.push_back(reference);
      if (head.find("].v[") != std::string::npos) velocities.push_back(reference);
    }
    std::sort(forces.begin(), forces.end());
    std::sort(velocities.begin(), velocities.end());
  }
};

double each(double seconds, std::size_t count) { return 1e9 * seconds / static_cast<double>(count); }

// One slave: what a call costs beside one that does nothing.
void small(const Library& ours, const Library& nothing, fmi2Component c, const Slaves& slaves) {
  double steps[2], empty[2], t = 0;
  const double h = 1e-6;
  int k = 0;
  for (const Library* library : {&ours, &nothing}) {
    TIEFMU_CALL(*library, fmi2DoStep);
    TIEFMU_CALL(*library, fmi2GetReal);
    TIEFMU_CALL(*library, fmi2SetReal);
    steps[k] = best([&] {
      check(fmi2DoStep(c, t, h, fmi2True));
      t += h;
    });
    empty[k] = best([&] { check(fmi2GetReal(c, slaves.velocities.data(), 0, nullptr)); });
    // What a master does in every step: set a force, step, get a velocity.
    double values[3] = {1, 2, 3};
    const double all = best([&] {
      check(fmi2SetReal(c, slaves.forces.data(), 3, values));
      check(fmi2DoStep(c, t, h, fmi2True));
      check(fmi2GetReal(c, slaves.velocities.data(), 3, values));
      t += h;
    });
    const bool own = library == &ours;
    row(own ? "dostep" : "dostep-nothing", 1, 1, 1e9 * steps[k], "ns per call");
    row(own ? "empty-get" : "empty-get-nothing", 1, 1, 1e9 * empty[k], "ns per call");
    row(own ? "set-step-get" : "set-step-get-nothing", 1, 1, 1e9 * all, "ns per three calls");
    ++k;
  }
  row("dostep-ratio", 1, 1, steps[0] / steps[1], "times the one that does nothing");
  row("guard", 1, 1, 1e9 * (empty[0] - empty[1]), "ns per call");
}

void values(const Library& ours, fmi2Component c, Slaves slaves) {
  TIEFMU_CALL(ours, fmi2GetReal);
  TIEFMU_CALL(ours, fmi2SetReal);
  std::vector<double> values(std::max(slaves.forces.size(), slaves.velocities.size()), 1.0);
  for (const char* order : {"", "-scattered"}) {
    const auto name = [&](const char* what) { return std::string(what) + order; };
    const References &in = slaves.forces, &out = slaves.velocities;
    row(name("set-real").c_str(), in.size(), 1,
        each(best([&] { check(fmi2SetReal(c, in.data(), in.size(), values.data())); }), in.size()), "ns per value");
    row(name("get-real").c_str(), out.size(), 1,
        each(best([&] { check(fmi2GetReal(c, out.data(), out.size(), values.data())); }), out.size()), "ns per value");
    bench::shuffle(slaves.forces);
    bench::shuffle(slaves.velocities);
  }
  std::vector<double> to(values.size());
  row("memcpy", to.size(), 1,
      each(best([&] {
             std::copy(values.begin(), values.end(), to.begin());
             asm volatile("" : : "r"(to.data()) : "memory");
           }),
           to.size()),
      "ns per value");
}

// One column of the Jacobian beside one step with set and get, and a state on its way out and back.
void large(const Library& ours, fmi2Component c, const Slaves& slaves) {
  TIEFMU_CALL(ours, fmi2GetReal);
  TIEFMU_CALL(ours, fmi2SetReal);
  TIEFMU_CALL(ours, fmi2DoStep);
  TIEFMU_CALL(ours, fmi2GetDirectionalDerivative);
  TIEFMU_CALL(ours, fmi2GetFMUstate);
  TIEFMU_CALL(ours, fmi2SetFMUstate);
  TIEFMU_CALL(ours, fmi2FreeFMUstate);
  TIEFMU_CALL(ours, fmi2SerializedFMUstateSize);
  TIEFMU_CALL(ours, fmi2SerializeFMUstate);
  TIEFMU_CALL(ours, fmi2DeSerializeFMUstate);
  const References &in = slaves.forces, &out = slaves.velocities;
  const std::size_t n = out.size() / 3;
  std::vector<double> values(std::max(in.size(), out.size()), 1.0);
  double t = 0;
  const double h = 1e-6, one = 1;
  const double step = best([&] {
    check(fmi2SetReal(c, in.data(), in.size(), values.data()));
    check(fmi2DoStep(c, t, h, fmi2True));
    check(fmi2GetReal(c, out.data(), out.size(), values.data()));
    t += h;
  });
  row("set-step-get", n, 1, each(step, n), "ns per slave");
  const double column =
      best([&] { check(fmi2GetDirectionalDerivative(c, out.data(), out.size(), in.data(), 1, &one, values.data())); });
  row("derivative-column", n, 1, each(column, n), "ns per slave");
  row("derivative-ratio", n, 1, column / step, "times a step with set and get");

  fmi2FMUstate state = nullptr;
  check(fmi2GetFMUstate(c, &state));
  row("state-get", n, 1, each(best([&] { check(fmi2GetFMUstate(c, &state)); }), n), "ns per slave");
  row("state-set", n, 1, each(best([&] { check(fmi2SetFMUstate(c, state)); }), n), "ns per slave");
  std::size_t size = 0;
  check(fmi2SerializedFMUstateSize(c, state, &size));
  std::vector<fmi2Byte> bytes(size);
  row("state-bytes", n, 1, static_cast<double>(size) / static_cast<double>(n), "bytes per slave");
  row("state-serialise", n, 1, each(best([&] { check(fmi2SerializeFMUstate(c, state, bytes.data(), size)); }), n),
      "ns per slave");
  row("state-deserialise", n, 1, each(best([&] { check(fmi2DeSerializeFMUstate(c, bytes.data(), size, &state)); }), n),
      "ns per slave");
  check(fmi2FreeFMUstate(c, &state));
}

}  // namespace

void bench::fmu(const char* folder, const char* nothingPath) {
  const std::string place = folder;
  const Library ours(binary(place)), nothing(nothingPath);
  TIEFMU_CALL(ours, fmi2Instantiate);
  TIEFMU_CALL(ours, fmi2SetupExperiment);
  TIEFMU_CALL(ours, fmi2EnterInitializationMode);
  TIEFMU_CALL(ours, fmi2ExitInitializationMode);
  TIEFMU_CALL(ours, fmi2FreeInstance);
  const Slaves slaves(place);
  const fmi2CallbackFunctions callbacks = {logMessage, std::calloc, std::free, nullptr, nullptr};
  const double start = now();
  fmi2Component c = fmi2Instantiate("bench", fmi2CoSimulation, slaves.guid.c_str(),
                                    ("file://" + place + "/resources").c_str(), &callbacks, fmi2False, fmi2False);
  if (!c) fail("the FMU cannot be instantiated");
  check(fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0));
  check(fmi2EnterInitializationMode(c));
  check(fmi2ExitInitializationMode(c));
  const std::size_t n = slaves.velocities.size() / 3;
  row("instantiate-initialise", n, 1, now() - start, "s");
  if (n == 1) {
    small(ours, nothing, c, slaves);
  } else {
    values(ours, c, slaves);
    large(ours, c, slaves);
  }
  fmi2FreeInstance(c);
}
