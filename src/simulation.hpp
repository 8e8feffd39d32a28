// One running instance of a model. Every number that a caller may set or get, and every number that a step changes,
// lives in one array (`data`), laid out once per model by `Layout`; a saved state is a copy of that array.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "model.hpp"

namespace tiefmu {

// Fields of the array, 3 doubles an entry for vectors. n: all nodes; r: rotating nodes; s: slaves; u: turning slaves.
enum class Field : int {
  // parameters
  timeStep, safety, slaveMass /*s*/, slaveInertia /*u*/,
  // computed from the parameters at the end of initialisation
  addedMass /*n*/, addedInertia /*r*/, stiffness /*n*/, rotationalStiffness /*r*/,
  // inputs
  nodeForce /*3n*/, nodeMoment /*3r*/, slaveForce /*3s*/, slaveMoment /*3u*/,
  // motion: inputs where a node is driven, states or results where it is free, zero where it is fixed
  acceleration /*3n*/, angularAcceleration /*3r*/, velocity /*3n*/, spin /*3r*/, position /*3n*/,
  // further states
  offset /*3u: d now*/, segmentRotation /*4 per meanMotion segment*/, orientation /*4 per Model::oriented*/,
  work /*external, dissipated*/, lagged /*velocity, spin that the last forces used*/,
  predicted /*velocity, spin that the last bias used*/, mode /*of the highest frequency*/, driven /*kinetic energy carried*/,
  // outputs
  slaveVelocity /*3s*/, slaveSpin /*3u*/, reactionForce /*3n*/, reactionMoment /*3r*/,
  slavePosition /*3s*/, slaveAcceleration /*3s*/,
  energy /*kinetic, strain, dissipated, external, residual*/, powerResidual, drift, stableTimeStep, nodalTimeStep,
  count
};

struct Slice {
  std::size_t offset = 0, count = 0;  // in doubles; count 0: this model has no such field
};

// Where each field of a model stands in the array.
struct Layout {
  explicit Layout(const Model& model);
  Slice operator[](Field f) const { return slices[static_cast<int>(f)]; }
  std::size_t size = 0;
  std::array<Slice, static_cast<int>(Field::count)> slices{};
};

// A step ended in a non-finite or runaway number; the state before the step has been put back.
struct Diverged : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Simulation {
 public:
  explicit Simulation(std::shared_ptr<const Model> model);
  ~Simulation();
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  const Model& model() const;
  const Layout& layout() const;
  double time() const;

  // The array. After writing to it call `inputsChanged` (inputs, states) or `parametersChanged`.
  double* data();
  const double* data() const;
  double* field(Field f) { return data() + layout()[f].offset; }
  const double* field(Field f) const { return data() + layout()[f].offset; }
  void inputsChanged();
  void parametersChanged();

  // Back to the start values, as constructed.
  void reset();
  // Start time, s. Then inertia, limits and the first outputs are there. Throws SceneError (e.g. free node without mass).
  void initialise(double time);
  // From time() to time() + duration (s, > 0, finite), in equal substeps of at most safety * limit. No allocation.
  // Throws Diverged.
  void step(double duration);
  // Brings outputs in line with the inputs last set; cheap when nothing changed.
  void updateOutputs();

  // Saved state: `data` and what stands beside it. `restore` takes only what `save` of the same model gave.
  struct State {
    std::vector<double> data;
    double time = 0;
    std::int64_t substeps = 0;
    std::uint32_t flags = 0;
  };
  void save(State& state) const;
  void restore(const State& state);

  // Forces evaluated so far (a machine-independent cost).
  std::int64_t evaluations() const;
  // Largest step the chosen integrator is stable at, damping included, s (1e30: none).
  double integratorLimit() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tiefmu
