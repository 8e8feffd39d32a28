#include "inputs.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <memory>

#include "../../fmu/instance.hpp"

extern "C" {
#include "fmi2Functions.h"
}

namespace {

using tiefmu::Instance;

struct Silence final : tiefmu::Log {
  Silence() { on = true; }

 private:
  void send(tiefmu::Severity, const char*, const char*) const noexcept override {}
};

// A step of not more than some hundred substeps.
double shortStep(const tiefmu::Model& model) {
  try {
    tiefmu::Simulation simulation(std::make_shared<const tiefmu::Model>(model));
    simulation.initialise(0);
    const double asked = model.settings.timeStep > 0 ? model.settings.timeStep : 1e30;
    return std::min({0.01, 100 * asked, 100 * model.settings.safety * simulation.integratorLimit()});
  } catch (const std::runtime_error&) {
    return 0.01;
  }
}

// Every function that computes, whatever the one before has said.
void use(fmi2Component c, std::size_t variables, double step) {
  std::vector<fmi2ValueReference> references(variables);
  for (std::size_t i = 0; i < variables; ++i) references[i] = static_cast<fmi2ValueReference>(i);
  std::vector<double> values(variables, 0.125), changes(variables);
  for (double time : {0.0, step}) {
    for (fmi2ValueReference r : references) fmi2SetReal(c, &r, 1, values.data());
    for (std::size_t i = 0; i < variables; i += 1 + variables / 8)
      fmi2GetDirectionalDerivative(c, &references[variables - 1 - i], 1, &references[i], 1, values.data(),
                                   changes.data());
    fmi2GetReal(c, references.data(), variables, changes.data());
    fmi2DoStep(c, time, step, fmi2True);
    fmi2GetReal(c, references.data(), variables, changes.data());
  }
  const fmi2Integer order = 1;
  for (std::size_t i = 0; i < variables; i += 1 + variables / 8)
    fmi2GetRealOutputDerivatives(c, &references[i], 1, &order, changes.data());
}

}  // namespace

bool takeResource(const unsigned char* bytes, std::size_t size) {
  tiefmu::Resource resource;
  try {
    resource = tiefmu::readResource({reinterpret_cast<const char*>(bytes), size});
  } catch (const tiefmu::ResourceError&) {
    return false;
  }
  const double step = shortStep(resource.model);
  const std::size_t variables =
      std::min<std::size_t>(200, tiefmu::Layout(resource.model).size);  // some of them are none: refused
  fmi2Component c = new Instance(std::make_unique<Silence>(), std::move(resource));
  fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0);
  fmi2EnterInitializationMode(c);
  fmi2ExitInitializationMode(c);
  use(c, variables, step);
  fmi2Reset(c);
  fmi2FreeInstance(c);
  return true;
}

bool takeState(const std::string& scene, const unsigned char* bytes, std::size_t size) {
  static const tiefmu::Resource read = [&] {
    std::ifstream stream(scene, std::ios::binary);
    return tiefmu::readResource(std::string{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()});
  }();
  tiefmu::Resource resource = read;
  const std::size_t variables = tiefmu::Layout(resource.model).size;
  fmi2Component c = new Instance(std::make_unique<Silence>(), std::move(resource));
  fmi2EnterInitializationMode(c);
  fmi2FMUstate state = nullptr;
  const bool taken = fmi2DeSerializeFMUstate(c, reinterpret_cast<const fmi2Byte*>(bytes), size, &state) == fmi2OK;
  if (taken) {
    fmi2SetFMUstate(c, state);
    fmi2ExitInitializationMode(c);
    use(c, std::min<std::size_t>(variables, 40), 0.001);
    std::size_t length = 0;
    fmi2SerializedFMUstateSize(c, state, &length);
    std::vector<fmi2Byte> again(length);
    fmi2SerializeFMUstate(c, state, again.data(), length);
  }
  fmi2Reset(c);
  fmi2FreeInstance(c);
  return taken;
}
