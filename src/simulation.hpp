// One running instance of a model. Every number that a caller may set or get, and every number that a step changes,
// lives in one array (`data`), laid out once per model by `Layout`; a saved state is a copy of that array.
#pragma once

#include <memory>
#include <vector>

#include "input_curve.hpp"
#include "layout.hpp"
#include "step_errors.hpp"

namespace tiefmu {

class Linearization;

class Simulation {
 public:
  explicit Simulation(std::shared_ptr<const Model> model);
  ~Simulation();
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  const Model& model() const;
  const Layout& layout() const;
  double time() const;  // s

  // The array. After writing to it call `inputsChanged`, `statesChanged` or `parametersChanged`.
  double* data();
  const double* data() const;
  double* field(Field f) { return data() + layout()[f].offset; }
  const double* field(Field f) const { return data() + layout()[f].offset; }
  void inputsChanged();
  void statesChanged();
  void parametersChanged();

  // Back to the start values, as constructed.
  void reset();
  // Start time, s. Then inertia, limits and the first outputs are there. Throws SceneError (e.g. free node without
  // mass).
  void initialise(double time);
  // How an input at `place` of the array moves inside the next step: order 1 (its rate) or 2. Afterwards the input
  // stands at the step's end.
  void setInputDerivative(std::size_t place, int order, double value);
  // Rate of change of every number of the array at the present state, by short trial steps with inputs moving as
  // their known rates say (velocities by the accelerations given). `rates` is laid out like `data`. First order.
  // The limits of the time step, which change in leaps, get zero. Throws Diverged; changes nothing.
  void outputRates(double* rates);
  // From time() to time() + duration (s, > 0, finite), in equal substeps of at most safety * limit. No allocation.
  // Throws Diverged, StepTooLong.
  void step(double duration);
  // Brings outputs in line with the inputs last set; cheap when nothing changed.
  void updateOutputs();
  // Then the reactions on free nodes too, which no variable shows and no step may need.
  void updateReactions();

  // Saved state: `data` and what stands beside it. `restore` takes only what `save` of the same model gave.
  struct State {
    std::vector<double> data;
    double time = 0;  // s
    std::int64_t substeps = 0;
    std::uint32_t flags = 0;
    std::vector<InputDerivatives> inputs;  // for the next step
  };
  void save(State& state) const;
  void restore(const State& state);

  // Derivatives of the outputs by the inputs at the present state, J; free nodes' motion is a state and does not
  // change. `array` is laid out like `data` and holds zeros but for what is given. Directional: of a change of the
  // inputs, that of every output, J dx. Adjoint: of weights of the outputs, the gradient of their sum along each input,
  // J^T y. All else that stands in the array then is scratch.
  void directionalDerivative(double* array);
  void adjointDerivative(double* array);

  // Forces evaluated so far (a machine-independent cost).
  std::int64_t evaluations() const;
  // Equal substeps that a step of this duration, s, is planned in now; 1 where nothing is integrated. Throws
  // StepTooLong.
  double substepsOf(double duration) const;
  // Largest step the chosen integrator is stable at, damping included, s (1e30: none).
  double integratorLimit() const;

 private:
  Linearization& linearised();

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tiefmu
