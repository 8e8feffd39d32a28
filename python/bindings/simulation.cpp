// A running instance of a model.
#include "../../src/simulation.hpp"

#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <memory>
#include <unordered_map>

#include "../../modelDescription/variables.hpp"
#include "bindings.hpp"
#include "convert.hpp"

namespace tiefmu {
namespace {

// A simulation with the FMU's view of it: fields by their names in src/fields.hpp, variables by
// their names in the FMU.
class NamedSimulation {
 public:
  explicit NamedSimulation(std::shared_ptr<Model> model)
      : simulation(std::move(model)), blocks(tiefmu::variables(simulation.model(), simulation.layout())) {}

  Array<double> get(const std::string& name) {
    const FieldRow& f = find(name);
    if (f.field == Field::reactionForce || f.field == Field::reactionMoment)
      simulation.updateReactions();
    else
      simulation.updateOutputs();
    const Slice slice = simulation.layout()[f.field];
    std::vector<double> values(simulation.field(f.field), simulation.field(f.field) + slice.count);
    if (f.components == 1 || f.per == Per::simulation) return numpy(std::move(values));
    const auto components = static_cast<std::size_t>(f.components);
    return numpy(std::move(values), {slice.count / components, components});
  }

  void set(const std::string& name, const Values& values) {
    const FieldRow& f = find(name);
    const Slice slice = simulation.layout()[f.field];
    require(values.size() == slice.count, "field '" + name + "' has " + std::to_string(slice.count) + " values, not " +
                                              std::to_string(values.size()));
    std::copy_n(values.data(), slice.count, simulation.field(f.field));
    changed(f.field);
  }

  nb::dict fields() const {
    nb::dict d;
    for (const FieldRow& f : fieldRows)
      if (const std::size_t count = simulation.layout()[f.field].count) d[f.name] = count;
    return d;
  }

  Array<double> getValues(const std::vector<std::string>& names) {
    simulation.updateOutputs();
    std::vector<double> values(names.size());
    for (std::size_t i = 0; i < names.size(); ++i) values[i] = simulation.data()[place(names[i]).second];
    return numpy(std::move(values));
  }

  void setValues(const std::vector<std::string>& names, const Doubles& values) {
    require(values.size() == names.size(), "as many values as names");
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto [block, at] = place(names[i]);
      require(block->causality == Causality::input || block->causality == Causality::parameter,
              "variable '" + names[i] + "' is neither an input nor a parameter");
      simulation.data()[at] = values.data()[i];
      changed(block->field);
    }
  }

  nb::list variables() const {
    static const char* const causalities[] = {"parameter", "calculatedParameter", "input", "output"};
    nb::list result;
    for (const Block& b : blocks) {
      nb::dict d;
      std::string name(b.prefix);
      if (!name.empty()) name += '.';
      d["name"] = name.append(b.name);
      d["prefix"] = b.prefix;
      d["components"] = b.components;
      d["causality"] = causalities[static_cast<int>(b.causality)];
      d["unit"] = b.unit;
      d["description"] = b.description;
      d["numbers"] = numpy(b.numbers);
      d["ids"] = numpy(b.ids);
      d["labels"] = b.labels;
      d["reference"] = b.reference;
      d["field"] = rowOf(b.field).name;
      d["computed"] = rowOf(b.field).role == Role::output;
      result.append(d);
    }
    return result;
  }

  std::vector<std::string> variableNames(std::size_t number) const {
    const Block& b = blocks.at(number);
    const std::size_t components = static_cast<std::size_t>(b.components);
    std::vector<std::string> names;
    for (std::size_t k = 0; k < b.count(); ++k)
      names.push_back(variableName(b, k / components, static_cast<int>(k % components)));
    return names;
  }

  Simulation simulation;

 private:
  static const FieldRow& find(const std::string& name) {
    for (const FieldRow& f : fieldRows)
      if (name == f.name) return f;
    throw nb::key_error(("no field '" + name + "'").c_str());
  }

  void changed(Field f) {
    switch (rowOf(f).role) {
      case Role::parameter: return simulation.parametersChanged();
      case Role::motion:
      case Role::state: return simulation.statesChanged();
      default: return simulation.inputsChanged();
    }
  }

  // Block of the variable and its place in the data.
  std::pair<const Block*, std::size_t> place(const std::string& name) {
    if (places.empty())
      for (const Block& b : blocks)
        for (std::size_t k = 0; k < b.count(); ++k) {
          const std::size_t components = static_cast<std::size_t>(b.components);
          places.emplace(variableName(b, k / components, static_cast<int>(k % components)), std::pair(&b, b.place + k));
        }
    const auto entry = places.find(name);
    if (entry == places.end()) throw nb::key_error(("no variable '" + name + "'").c_str());
    return entry->second;
  }

  std::vector<Block> blocks;
  std::unordered_map<std::string, std::pair<const Block*, std::size_t>> places;  // filled when first asked
};

}  // namespace

void bindSimulation(nb::module_& m) {
  nb::class_<Simulation::State>(m, "State", "A saved state; only for `restore` of a simulation of the same model.")
      .def_prop_ro("time", [](const Simulation::State& s) { return s.time; });

  nb::class_<NamedSimulation>(m, "Simulation", "One running instance of a model, as the FMU runs it.")
      .def(nb::init<std::shared_ptr<Model>>(), "model"_a)
      .def(
          "reset", [](NamedSimulation& r) { r.simulation.reset(); }, "Back to the start values, as constructed.")
      .def(
          "initialise",
          [](NamedSimulation& r, double t) {
            require(std::isfinite(t), "the start time is not finite");
            r.simulation.initialise(t);
          },
          "time"_a = 0.0, "Start time, s. Raises SceneError, e.g. for a free node without mass.")
      .def(
          "step",
          [](NamedSimulation& r, double h) {
            require(h > 0 && std::isfinite(h), "a step's duration is a finite number of seconds above 0");
            r.simulation.step(h);
          },
          "duration"_a,
          "Forward by `duration` s, in equal substeps within the limit. Raises ValueError, Diverged, StepTooLong.")
      .def(
          "update_outputs", [](NamedSimulation& r) { r.simulation.updateOutputs(); },
          "Brings outputs in line with the inputs last set; the getters do it by themselves.")
      .def("get", &NamedSimulation::get, "field"_a,
           "A copy of the field: (n, 3), (n, 4) or (n), rows as in Model.report().")
      .def("set", &NamedSimulation::set, "field"_a, "values"_a,
           "Writes the whole field, of any shape with as many values.")
      .def("get_values", &NamedSimulation::getValues, "names"_a,
           "Values of variables by their FMU names, e.g. slave[1].v[3].")
      .def("set_values", &NamedSimulation::setValues, "names"_a, "values"_a,
           "Sets inputs and parameters by their FMU names.")
      .def("save",
           [](const NamedSimulation& r) {
             Simulation::State state;
             r.simulation.save(state);
             return state;
           })
      .def(
          "restore",
          [](NamedSimulation& r, const Simulation::State& state) {
            require(state.data.size() == r.simulation.layout().size, "the state is of another model");
            r.simulation.restore(state);
          },
          "state"_a)
      .def_prop_ro("fields", &NamedSimulation::fields, "Names of the model's fields and how many values each has.")
      .def_prop_ro("variables", &NamedSimulation::variables,
                   "The FMU's variables, as a list of blocks in value reference order.")
      .def("variable_names", &NamedSimulation::variableNames, "block"_a,
           "FMU names of the block of this number in `variables`, in value reference order, e.g. slave[1].v[3].")
      .def_prop_ro("time", [](const NamedSimulation& r) { return r.simulation.time(); })
      .def_prop_ro(
          "evaluations", [](const NamedSimulation& r) { return r.simulation.evaluations(); },
          "Force evaluations so far.")
      .def_prop_ro(
          "integrator_limit", [](const NamedSimulation& r) { return r.simulation.integratorLimit(); },
          "Largest stable step of the chosen integrator, damping included, s (1e30: none).");
}

}  // namespace tiefmu
