#include "simulation.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>

#include "divergence.hpp"
#include "dynamics.hpp"
#include "integrator.hpp"
#include "linearization.hpp"
#include "outputs.hpp"
#include "step_backup.hpp"
#include "time_step_limit.hpp"

namespace tiefmu {
namespace {

constexpr int checkEvery = 16;  // substeps between two looks for divergence
constexpr double maxSubsteps = 1e9;
constexpr double none = 1e30;

enum Flag : std::uint32_t { accelerationsValid = 1, energyStarted = 2, initialised = 4, stepped = 8 };

}  // namespace

struct Simulation::Impl {
  std::shared_ptr<const Model> model;
  Layout layout;
  std::vector<double> data;
  Dynamics dynamics;
  Integrator integrator;
  TimeStepLimit limit;
  DivergenceChecks checks;
  Outputs outputs;
  StepBackup backup;
  std::unique_ptr<Linearization> linearization;  // made at its first use
  double time = 0;
  std::int64_t substeps = 0;
  std::uint32_t flags = 0;
  bool energy = false, integrates = false;
  // What is derived from `data`, never saved, and must be computed anew before it is read.
  bool portsDirty = true;  // motion of the ports' nodes
  bool geometryDirty = true, loadsDirty = true, outputsDirty = true, parametersDirty = true;
  bool prepared = false;

  explicit Impl(std::shared_ptr<const Model> m)
      : model(std::move(m)),
        layout(*model),
        data(layout.size),
        dynamics(*model, layout, data.data()),
        integrator(dynamics),
        limit(dynamics),
        checks(dynamics),
        outputs(dynamics),
        backup(dynamics) {
    energy = layout[Field::energy].count > 0;
    for (Field f : {Field::position, Field::segmentRotation, Field::orientation, Field::angle})
      integrates |= layout[f].count > 0;
    for (int s = 0; s < 3 * model->turning(); ++s) integrates |= model->finite() && model->slaveOffset[s] != 0;
  }

  double* field(Field f) { return data.data() + layout[f].offset; }

  void updatePorts() {
    if (portsDirty && dynamics.ports.anyDriven()) dynamics.movePorts();
    portsDirty = false;
  }

  void updateGeometry() {
    updatePorts();
    if (!geometryDirty) return;
    dynamics.ties.updateGeometry();
    checks.checkSegments(time);
    if (flags & accelerationsValid) dynamics.updateMass();  // a restored state: nothing else will
    geometryDirty = false;
  }

  void evaluate() {
    updateGeometry();
    if (model->anyFree() && !(flags & accelerationsValid)) {
      dynamics.evaluate();
      flags |= accelerationsValid;
    } else if (loadsDirty) {
      dynamics.evaluateLoads();
    }
    loadsDirty = false;
    checks.checkPorts(time, 0);
  }

  double totalEnergy() { return dynamics.kineticEnergy() + dynamics.strainEnergy(); }

  // In `loads` the host carries the inertia it accelerates: what a new input velocity adds is its work.
  void startEnergy() {
    double* work = field(Field::work);
    const double total = totalEnergy();
    if (!(flags & energyStarted)) {
      work[Work::totalAtStart] = total;
      flags |= energyStarted;
    } else if (model->settings.reaction == Reaction::loads && model->anyDriven()) {
      work[Work::external] += total - work[Work::totalAtLastStep];
    }
    work[Work::totalAtLastStep] = total;
  }

  void undo() {
    backup.restore();
    flags &= ~accelerationsValid;
    geometryDirty = loadsDirty = outputsDirty = portsDirty = true;
  }

  // All nodes are driven: positions and rotations follow the velocities, and nothing is integrated else.
  void carry(double duration) {
    dynamics.inputs.begin(data.data());
    updateGeometry();
    Dynamics::Power before{};
    if (energy) {
      evaluate();
      startEnergy();
      before = dynamics.power();
    }
    dynamics.inputsOver(0, duration);
    if (dynamics.has(Field::position) && model->settings.position == Position::integrated)
      checks.checkPositions(time, duration);
    if (integrates) dynamics.drift(duration, 0);
    dynamics.inputsAt(0, duration);
    checks.checkSegments(time);
    time += duration;
    if (!energy) return;
    dynamics.evaluateLoads();
    const Dynamics::Power after = dynamics.power();
    field(Field::work)[Work::external] += 0.5 * duration * (before.external + after.external);
    field(Field::work)[Work::dissipated] += 0.5 * duration * (before.dissipated + after.dissipated);
    field(Field::work)[Work::totalAtLastStep] = totalEnergy();
  }

  double substepsOf(double duration) const {
    const double largest = limit.ofStep();
    const double count = std::max(1.0, std::ceil(duration / largest * (1 - 1e-12)));
    if (count <= maxSubsteps) return count;
    char text[160];
    std::snprintf(text, sizeof text, "a step of %.6g s would take %.3g substeps of at most %.3g s", duration, count,
                  largest);
    throw StepTooLong(text);
  }

  void integrate(double duration) {
    const double end = time + duration;
    double left = duration;
    dynamics.inputs.begin(data.data());
    evaluate();
    if (energy) startEnergy();
    Dynamics::Power before{};
    if (energy) before = dynamics.power();
    while (left > 0) {
      // Equal substeps; planned anew only when the limit has fallen below them.
      const double count = substepsOf(left);
      const std::int64_t n = static_cast<std::int64_t>(count);
      const double h = left / count;
      std::int64_t done = 0;
      while (done < n) {
        if (!(flags & accelerationsValid)) {
          dynamics.evaluate();
          flags |= accelerationsValid;
        }
        if (!integrator.step(duration - left + static_cast<double>(done) * h, h)) flags &= ~accelerationsValid;
        ++done;
        ++substeps;
        if (energy) {
          evaluate();
          const Dynamics::Power after = dynamics.power();
          if (model->settings.method != Method::rk4) {  // which integrates them with the rest
            field(Field::work)[Work::external] += 0.5 * h * (before.external + after.external);
            field(Field::work)[Work::dissipated] += 0.5 * h * (before.dissipated + after.dissipated);
          }
          before = after;
        }
        if (substeps % checkEvery == 0) checks.checkVelocities(time, limit.ofMethod());
        limit.update(h, substeps);
        if (limit.ofStep() < h * (1 - 1e-9)) break;
      }
      left = done < n ? left - static_cast<double>(done) * h : 0;
    }
    time = end;
    checks.checkVelocities(time, limit.ofMethod());
    if (dynamics.has(Field::position)) checks.checkPositions(time, 0);
    checks.checkPorts(time, 0);
    checks.checkSegments(time);
    if (energy) field(Field::work)[Work::totalAtLastStep] = totalEnergy();
  }

  // Simulation::step but for what it leaves for the answers after it.
  void advance(double duration) {
    const double before = time;
    const std::int64_t substepsBefore = substeps;
    const auto restore = [&] {
      undo();
      time = before;
      substeps = substepsBefore;
    };
    backup.save();
    try {
      checks.checkPorts(time, duration);
      if (model->anyFree())
        integrate(duration);
      else
        carry(duration);
      dynamics.inputs.clear();
      outputsDirty = true;
      if (!model->anyFree()) loadsDirty = true;
    } catch (const SceneError& e) {  // the mass matrix of a geometry that has blown up
      restore();
      throw Diverged("diverged after t = " + std::to_string(before) + " s: " + e.what());
    } catch (...) {
      restore();
      throw;
    }
  }
};

Simulation::Simulation(std::shared_ptr<const Model> model) : impl_(std::make_unique<Impl>(std::move(model))) {
  reset();
}
Simulation::~Simulation() = default;

const Model& Simulation::model() const { return *impl_->model; }
const Layout& Simulation::layout() const { return impl_->layout; }
double Simulation::time() const { return impl_->time; }
double* Simulation::data() { return impl_->data.data(); }
const double* Simulation::data() const { return impl_->data.data(); }
std::int64_t Simulation::evaluations() const { return impl_->dynamics.evaluations; }
double Simulation::integratorLimit() const { return impl_->limit.ofMethod(); }

void Simulation::inputsChanged() {
  impl_->flags &= ~accelerationsValid;
  impl_->loadsDirty = impl_->outputsDirty = impl_->portsDirty = true;
  impl_->geometryDirty = impl_->model->settings.position == Position::input || impl_->geometryDirty;
  impl_->dynamics.takeDrivenVelocities();
}

void Simulation::statesChanged() {
  inputsChanged();
  impl_->geometryDirty = true;
}

void Simulation::parametersChanged() {
  impl_->parametersDirty = true;
  inputsChanged();
}

void Simulation::setInputDerivative(std::size_t place, int order, double value) {
  assert(place < impl_->layout.size && (order == 1 || order == 2));
  impl_->dynamics.inputs.set(place, order, value, impl_->layout);
}

void Simulation::outputRates(double* rates) {
  Impl& s = *impl_;
  updateOutputs();
  State before;
  save(before);
  const std::int64_t evaluations = s.dynamics.evaluations;
  const auto undo = [&] {
    restore(before);
    s.dynamics.evaluations = evaluations;
  };
  const double limit = s.model->anyFree() ? s.limit.ofStep() : none;
  const double h = 1e-5 * std::min(limit, 1.0);
  try {
    if (s.model->accelerationInputs())
      for (const auto& [motion, rate] :
           {std::pair{Field::velocity, Field::acceleration}, std::pair{Field::spin, Field::angularAcceleration}})
        for (std::size_t k = 0; k < s.layout[motion].count; ++k) {
          const int node = static_cast<int>(k / 3);
          const std::size_t place = s.layout[motion].offset + k;
          if ((node >= s.model->freeBegin() && node < s.model->freeEnd()) || s.dynamics.ports.moves(node)) continue;
          if (!s.dynamics.inputs.knows(place)) setInputDerivative(place, 1, s.field(rate)[k]);
        }
    if (s.model->accelerationInputs())
      for (const auto& [motion, rate] : {std::pair{Field::portVelocity, Field::portAcceleration},
                                         std::pair{Field::portSpin, Field::portAngularAcceleration}})
        for (std::size_t k = 0; k < s.layout[motion].count; ++k)
          if (const std::size_t place = s.layout[motion].offset + k; !s.dynamics.inputs.knows(place))
            setInputDerivative(place, 1, s.field(rate)[k]);
    // Nothing of an earlier step's half-step velocities; what the outputs hold of their start is gone after the first
    // of two steps.
    s.dynamics.setForceVelocities(0, 0);
    s.flags &= ~accelerationsValid;
    s.loadsDirty = true;
    std::vector<InputDerivatives> inputs = s.dynamics.inputs.all();
    s.advance(h);
    updateOutputs();
    std::copy(s.data.begin(), s.data.end(), rates);
    for (InputDerivatives& d : inputs) d.first += h * d.second;
    s.dynamics.inputs.assign(inputs, s.layout);
    s.advance(h);
    updateOutputs();
  } catch (...) {
    undo();
    throw;
  }
  for (std::size_t k = 0; k < s.layout.size; ++k) rates[k] = (s.data[k] - rates[k]) / h;
  for (Field f : {Field::stableTimeStep, Field::nodalTimeStep}) rates[s.layout[f].offset] = 0;
  undo();
}

void Simulation::reset() {
  impl_->dynamics.inputs.clear();
  Impl& s = *impl_;
  s.dynamics.setStart();
  s.dynamics.evaluations = 0;
  s.time = 0;
  s.substeps = 0;
  s.flags = 0;
  s.geometryDirty = s.loadsDirty = s.outputsDirty = s.parametersDirty = s.portsDirty = true;
}

void Simulation::initialise(double time) {
  Impl& s = *impl_;
  s.time = time;
  s.updatePorts();
  s.dynamics.prepare();
  s.checks.checkSegments(time);
  s.limit.compute();
  s.flags = initialised;
  s.prepared = true;
  s.geometryDirty = s.parametersDirty = false;
  s.loadsDirty = s.outputsDirty = true;
  if (s.energy) {
    s.evaluate();
    s.startEnergy();
  }
}

void Simulation::step(double duration) {
  assert(duration > 0 && std::isfinite(duration));
  Impl& s = *impl_;
  s.advance(duration);
  s.dynamics.holdAccelerations((s.flags & stepped) != 0);
  s.flags |= stepped;
}

double Simulation::substepsOf(double duration) const {
  return impl_->model->anyFree() ? impl_->substepsOf(duration) : 1;
}

void Simulation::updateOutputs() {
  Impl& s = *impl_;
  s.updatePorts();
  if (s.parametersDirty) {  // during initialisation parameters may still change
    s.dynamics.prepare();
    s.limit.compute();
    s.prepared = true;
    s.parametersDirty = false;
  }
  if (!s.outputsDirty) return;
  s.evaluate();
  s.outputs.update();
  s.outputsDirty = false;
}

void Simulation::updateReactions() {
  updateOutputs();
  impl_->dynamics.bringReactions();
}

Linearization& Simulation::linearised() {
  updateOutputs();
  if (!impl_->linearization) impl_->linearization = std::make_unique<Linearization>(impl_->dynamics);
  return *impl_->linearization;
}

void Simulation::directionalDerivative(double* array) { linearised().directional(array); }
void Simulation::adjointDerivative(double* array) { linearised().adjoint(array); }

void Simulation::save(State& state) const {
  const Impl& s = *impl_;
  state.data.assign(s.data.begin(), s.data.end());
  state.time = s.time;
  state.substeps = s.substeps;
  state.flags = s.flags;
  state.inputs = s.dynamics.inputs.all();
}

void Simulation::restore(const State& state) {
  Impl& s = *impl_;
  assert(state.data.size() == s.layout.size);
  // What `prepare` keeps beside the array depends on the slaves' masses only.
  static_assert(adjacent(Field::slaveMass, Field::slaveInertia));
  const Slice masses = s.layout.through(Field::slaveMass, Field::slaveInertia);
  const bool sameMasses =
      std::equal(state.data.begin() + masses.offset, state.data.begin() + masses.end(), s.data.begin() + masses.offset);
  std::copy(state.data.begin(), state.data.end(), s.data.begin());
  s.time = state.time;
  s.substeps = state.substeps;
  s.flags = state.flags;
  s.dynamics.inputs.assign(state.inputs, s.layout);
  if (!s.prepared || !sameMasses) s.dynamics.prepareMass();
  s.prepared = true;
  s.geometryDirty = s.loadsDirty = s.outputsDirty = s.portsDirty = true;
  s.parametersDirty = !(s.flags & initialised);
}

}  // namespace tiefmu
