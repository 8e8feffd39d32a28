#include "simulation.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>

#include "dynamics.hpp"
#include "integrator.hpp"
#include "stability.hpp"

namespace tiefmu {
namespace {

constexpr double runaway = 3e8;       // m/s, rad/s: no explicit solution that is still one gets there
constexpr double farAway = 1e30;      // m: beyond it squares of lengths overflow before long
constexpr int refreshEvery = 100;     // substeps between two looks at the highest frequency, at most
constexpr double refreshTurn = 0.1;   // rad that the geometry turns between them, at most
constexpr double largestTurn = 0.25;  // rad a substep, where the bias of consistent inertia is explicit
constexpr int checkEvery = 16;        // substeps between two looks for divergence
constexpr double maxSubsteps = 1e9;
constexpr double none = 1e30;

enum Flag : std::uint32_t { accelerationsValid = 1, energyStarted = 2, initialised = 4 };

}  // namespace

struct Simulation::Impl {
  std::shared_ptr<const Model> model;
  Layout layout;
  std::vector<double> data;
  Dynamics dynamics;
  Integrator integrator;
  Spectrum spectrum;
  // What a step changes and cannot compute anew: the fields velocity .. integratorLimit (all driven: position .. work),
  // without offsets where they follow from the segments' rotations.
  std::vector<double> backup;
  Slice kept[2];
  double time = 0;
  std::int64_t substeps = 0;
  std::uint32_t flags = 0;
  bool dampers = false, energy = false, integrates = false;
  // Derived from `data`, never saved: geometry, gathered loads and outputs behind the inputs.
  bool geometryDirty = true, loadsDirty = true, outputsDirty = true, parametersDirty = true;
  bool portsDirty = true;  // the ports' nodes
  bool prepared = false;

  explicit Impl(std::shared_ptr<const Model> m)
      : model(std::move(m)),
        layout(*model),
        data(layout.size),
        dynamics(*model, layout, data.data()),
        integrator(dynamics),
        spectrum(dynamics) {
    dampers = layout[Field::lagged].count > 0;
    energy = layout[Field::energy].count > 0;
    for (Field f : {Field::position, Field::segmentRotation, Field::orientation, Field::angle})
      integrates |= layout[f].count > 0;
    if (model->anyFree()) {
      const bool own = std::any_of(model->groups.begin(), model->groups.end(),
                                   [](const TieGroup& g) { return g.coupling == Coupling::rotation; });
      static_assert(allAre(Field::velocity, Field::position, Role::motion));
      static_assert(adjacent(Field::position, Field::offset) && adjacent(Field::offset, Field::segmentRotation));
      static_assert(allAre(Field::offset, Field::integratorLimit, Role::state));
      kept[0] = layout.through(Field::velocity, Field::position);
      kept[1] = layout.through(own ? Field::offset : Field::segmentRotation, Field::integratorLimit);
      backup.resize(kept[0].count + kept[1].count);
    }
    // An all-driven scene loses what it cannot compute anew only where a segment collapses.
    const bool frames = std::any_of(model->groups.begin(), model->groups.end(),
                                    [](const TieGroup& g) { return g.coupling == Coupling::meanMotion; });
    if (!model->anyFree() && frames && model->finite()) {
      const bool own = std::any_of(model->groups.begin(), model->groups.end(),
                                   [](const TieGroup& g) { return g.coupling == Coupling::rotation; });
      static_assert(allAre(Field::segmentRotation, Field::work, Role::state));
      kept[0] = layout.through(Field::position, own ? Field::offset : Field::position);
      kept[1] = layout.through(Field::segmentRotation, Field::work);
      backup.resize(kept[0].count + kept[1].count);
    }
    for (int s = 0; s < 3 * model->turning(); ++s) integrates |= model->finite() && model->slaveOffset[s] != 0;
  }

  double* field(Field f) { return data.data() + layout[f].offset; }

  double methodLimit() { return *field(Field::integratorLimit); }
  double stepLimit() {
    const double limit = *field(Field::safety) * methodLimit();
    const double asked = *field(Field::timeStep);
    const double turn = dynamics.hasBias() ? largestTurn / std::max(dynamics.turnRate(), 1e-30) : none;
    return std::min({asked > 0 ? asked : none, limit, turn});
  }

  void computeLimits() {
    double &frequency = *field(Field::highestFrequency), &damping = *field(Field::dampingRate);
    frequency = damping = *field(Field::angleTurned) = 0;
    *field(Field::nodalTimeStep) = nodalStep(*model, field(Field::addedMass), field(Field::addedInertia),
                                             field(Field::stiffness), field(Field::rotationalStiffness));
    if (model->anyFree() && !model->springs.empty()) {
      frequency = std::sqrt(spectrum.largest(false, layout[Field::mode].count ? field(Field::mode) : nullptr).bound());
      if (dampers) damping = spectrum.largest(true, nullptr).bound();
    }
    setLimits();
  }

  void setLimits() {
    const double frequency = *field(Field::highestFrequency);
    *field(Field::stableTimeStep) = frequency > 0 ? 2 / frequency : none;
    *field(Field::integratorLimit) = stableStep(model->settings.method, frequency, *field(Field::dampingRate));
  }

  // Geometry changes the limit; the mode of the last look is where the next one starts.
  void refreshLimits() {
    *field(Field::angleTurned) = 0;
    if (layout[Field::mode].count == 0) return;
    const Spectrum::Value value = spectrum.refresh(field(Field::mode));
    if (value.ritz > 0 && std::isfinite(value.bound())) {
      *field(Field::highestFrequency) = std::sqrt(value.bound());
      setLimits();
    }
  }

  void updatePorts() {
    if (portsDirty && dynamics.ports.anyDriven()) dynamics.movePorts();
    portsDirty = false;
  }

  void updateGeometry() {
    updatePorts();
    if (!geometryDirty) return;
    dynamics.updateGeometry();
    checkSegments();
    if (flags & accelerationsValid) dynamics.updateMass();  // a restored state: nothing else will
    geometryDirty = false;
  }

  void evaluate() {
    updateGeometry();
    if (model->anyFree() && !(flags & accelerationsValid)) {
      dynamics.evaluate();
      flags |= accelerationsValid;
    } else if (loadsDirty) {
      dynamics.evaluateReactions();
    }
    loadsDirty = false;
    checkPorts(0);
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

  bool allWithin(std::size_t count, const double* value, double limit) {
    std::atomic<bool> result{true};
    dynamics.eachBlock(count, [&](std::size_t first, std::size_t last) {
      if (!within(last - first, value + first, limit)) result = false;
    });
    return result;
  }

  void checkFinite() {
    if (!model->anyFree()) return;
    for (Field f : {Field::velocity, Field::spin}) {
      const double* v = field(f);
      const int last = f == Field::velocity ? model->freeEnd() : model->rotating();
      if (allWithin(3 * (last - model->freeBegin()), v + 3 * model->freeBegin(), runaway)) continue;
      for (int i = model->freeBegin(); i < last; ++i)
        for (int k = 0; k < 3; ++k) {
          if (std::abs(v[3 * i + k]) < runaway) continue;  // false for NaN
          char text[200];
          std::snprintf(
              text, sizeof text, "diverged at t = %.9g s: %s of node %lld is %.3g %s; limit of the time step %.3g s",
              time, f == Field::velocity ? "velocity" : "angular velocity", static_cast<long long>(model->nodeId[i]),
              v[3 * i + k], f == Field::velocity ? "m/s" : "rad/s", methodLimit());
          throw Diverged(text, layout[f].offset + static_cast<std::size_t>(3 * i + k));
        }
    }
  }

  // Of all nodes after h more at the present velocities (0: as they stand).
  void checkPlaces(double h) {
    const double *x = field(Field::position), *v = field(Field::velocity);
    const std::size_t count = layout[Field::position].count;
    if (allWithin(count, x, farAway / 2) && (h == 0 || allWithin(count, v, farAway / (2 * h)))) return;
    for (std::size_t k = 0; k < layout[Field::position].count; ++k) {
      if (std::abs(x[k] + h * v[k]) < farAway) continue;  // false for NaN
      char text[120];
      std::snprintf(text, sizeof text, "diverged at t = %.9g s: position of node %lld is %.3g m", time,
                    static_cast<long long>(model->nodeId[k / 3]), x[k] + h * v[k]);
      throw Diverged(text, layout[Field::position].offset + k);
    }
  }

  // Ports of driven nodes after h more at the present velocities, and whether those of slaves still have a rotation.
  void checkPorts(double h) {
    if (model->ports.empty()) return;
    char text[80];
    std::snprintf(text, sizeof text, "diverged at t = %.9g s: ", time);
    for (const auto& [place, rate] :
         {std::pair{Field::portPlace, Field::portVelocity}, std::pair{Field::portRotation, Field::portSpin}})
      for (std::size_t k = 0; k < layout[rate].count; ++k) {
        const double from = place == Field::portPlace ? field(place)[k] : 0;
        if (std::abs(from + h * field(rate)[k]) < farAway) continue;  // false for NaN
        throw Diverged(text + ("port '" + model->ports[k / 3].name) + "' leaves the world", layout[rate].offset + k);
      }
    const std::string flat = dynamics.ports.findCollapsed();
    if (!flat.empty()) throw Diverged(text + ("the slaves of port '" + flat) + "' have come to lie on a line");
  }

  void checkSegments() {
    if (!model->finite()) return;
    const std::string nodes = dynamics.findCollapsedSegment();
    if (nodes.empty()) return;
    char text[80];
    std::snprintf(text, sizeof text, "diverged at t = %.9g s: ", time);
    throw Diverged(text + ("the segment of nodes " + nodes) + " has collapsed to a line or a point");
  }

  void save() {
    std::size_t to = 0;
    for (const Slice& slice : kept) {
      dynamics.eachBlock(slice.count, [&](std::size_t first, std::size_t last) {
        std::copy_n(data.begin() + slice.offset + first, last - first, backup.begin() + to + first);
      });
      to += slice.count;
    }
  }
  void undo() {
    dynamics.inputs.at(0, data.data());
    std::copy_n(backup.begin(), kept[0].count, data.begin() + kept[0].offset);
    std::copy_n(backup.begin() + kept[0].count, kept[1].count, data.begin() + kept[1].offset);
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
    if (dynamics.has(Field::position) && model->settings.position == Position::integrated) checkPlaces(duration);
    if (integrates) dynamics.drift(duration, 0);
    dynamics.inputsAt(0, duration);
    checkSegments();
    time += duration;
    if (!energy) return;
    dynamics.evaluateReactions();
    const Dynamics::Power after = dynamics.power();
    field(Field::work)[Work::external] += 0.5 * duration * (before.external + after.external);
    field(Field::work)[Work::dissipated] += 0.5 * duration * (before.dissipated + after.dissipated);
    field(Field::work)[Work::totalAtLastStep] = totalEnergy();
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
      double limit = stepLimit();
      const double count = std::max(1.0, std::ceil(left / limit * (1 - 1e-12)));
      if (!(count <= maxSubsteps)) {
        char text[160];
        std::snprintf(text, sizeof text, "a step of %.6g s would take %.3g substeps of at most %.3g s", duration, count,
                      limit);
        throw StepTooLong(text);
      }
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
        if (substeps % checkEvery == 0) checkFinite();
        double& turned = *field(Field::angleTurned);
        turned += h * dynamics.turnRate();
        if (substeps % refreshEvery == 0 || turned > refreshTurn) refreshLimits();
        if (stepLimit() < h * (1 - 1e-9)) break;
      }
      left = done < n ? left - static_cast<double>(done) * h : 0;
    }
    time = end;
    checkFinite();
    if (dynamics.has(Field::position)) checkPlaces(0);
    checkPorts(0);
    checkSegments();
    if (energy) field(Field::work)[Work::totalAtLastStep] = totalEnergy();
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
double Simulation::integratorLimit() const { return impl_->methodLimit(); }

void Simulation::inputsChanged() {
  impl_->flags &= ~accelerationsValid;
  impl_->loadsDirty = impl_->outputsDirty = impl_->portsDirty = true;
  impl_->geometryDirty = impl_->model->settings.position == Position::input || impl_->geometryDirty;
  impl_->dynamics.takeDrivenVelocities();
}

void Simulation::parametersChanged() {
  impl_->parametersDirty = true;
  inputsChanged();
}

void Simulation::setInputDerivative(std::size_t place, int order, double value) {
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
  const double limit = s.model->anyFree() ? s.stepLimit() : none;
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
    step(h);
    updateOutputs();
    std::copy(s.data.begin(), s.data.end(), rates);
    for (InputDerivatives& d : inputs) d.first += h * d.second;
    s.dynamics.inputs.assign(inputs, s.layout);
    step(h);
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
  s.checkSegments();
  s.computeLimits();
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
  Impl& s = *impl_;
  const double time = s.time;
  const std::int64_t substeps = s.substeps;
  const auto undo = [&] {
    s.undo();
    s.time = time;
    s.substeps = substeps;
  };
  s.save();
  try {
    s.checkPorts(duration);
    if (s.model->anyFree())
      s.integrate(duration);
    else
      s.carry(duration);
    s.dynamics.inputs.clear();
    s.outputsDirty = true;
    if (!s.model->anyFree()) s.loadsDirty = true;
  } catch (const SceneError& e) {  // the mass matrix of a geometry that has blown up
    undo();
    throw Diverged("diverged after t = " + std::to_string(time) + " s: " + e.what());
  } catch (...) {
    undo();
    throw;
  }
}

void Simulation::updateOutputs() {
  Impl& s = *impl_;
  s.updatePorts();
  if (s.parametersDirty) {  // during initialisation parameters may still change
    s.dynamics.prepare();
    s.computeLimits();
    s.prepared = true;
    s.parametersDirty = false;
  }
  if (!s.outputsDirty) return;
  s.evaluate();
  s.dynamics.updateOutputs();
  s.outputsDirty = false;
}

void Simulation::directionalDerivative(double* derivative) {
  updateOutputs();
  impl_->dynamics.directionalDerivative(derivative);
}

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
