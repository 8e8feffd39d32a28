#include "variables.hpp"

#include <algorithm>
#include <string_view>

namespace tiefmu {
namespace {

// One row a name: what the variable is called, and by which name `expose` and `hide` speak of it.
struct Row {
  std::string_view prefix, name;
  std::string_view listed;  // name in expose and hide
  bool extra;               // only if exposed
  int components;
  std::string_view unit, description;
};

constexpr Row rows[] = {
    {"", "integrator.time_step", "integrator.time_step", false, 1, "s", "time step; 0: safety times the limit"},
    {"", "integrator.safety", "integrator.safety", false, 1, "1", "part of the limit that a time step may take"},
    {"", "integrator.threads", "integrator.threads", false, 1, "1",
     "threads that share a step; results do not depend on it"},
    {"", "stable_time_step", "stable_time_step", false, 1, "s", "limit 2/omega_max of the assembled system"},
    {"", "nodal_time_step", "nodal_time_step", false, 1, "s", "smallest sqrt(2 m/K) of all master nodes"},
    {"", "energy.kinetic", "energy", true, 1, "J", "kinetic energy"},
    {"", "energy.strain", "energy", true, 1, "J", "strain energy of the springs"},
    {"", "energy.dissipated", "energy", true, 1, "J", "work done on the dampers"},
    {"", "energy.external", "energy", true, 1, "J", "work of external loads and driven nodes"},
    {"", "energy.residual", "energy", true, 1, "J", "energy that the balance does not account for"},
    {"", "power_residual", "power_residual", true, 1, "W", "sum of force times velocity over the interface"},
    {"", "drift", "drift", true, 1, "m", "largest change of an offset's length since the start"},
    {"master", "v", "master.v", false, 3, "m/s", "velocity"},
    {"master", "w", "master.w", false, 3, "rad/s", "angular velocity"},
    {"master", "a", "master.a", false, 3, "m/s2", "acceleration"},
    {"master", "z", "master.z", false, 3, "rad/s2", "angular acceleration"},
    {"master", "r", "master.r", false, 3, "m", "position"},
    {"master", "f_ext", "master.f_ext", false, 3, "N", "external force on the node"},
    {"master", "t_ext", "master.t_ext", false, 3, "N.m", "external moment on the node"},
    {"master", "f", "master.f", false, 3, "N", "reaction: force of the tie on the node"},
    {"master", "t", "master.t", false, 3, "N.m", "reaction: moment of the tie on the node"},
    {"master", "added_mass", "master.added_mass", false, 1, "kg", "mass that the tie adds to the node"},
    {"master", "added_inertia", "master.added_inertia", false, 1, "kg.m2", "inertia that the tie adds to the node"},
    {"master", "stiffness", "master.stiffness", true, 1, "N/m", "nodal stiffness, slaves included"},
    {"master", "rotational_stiffness", "master.stiffness", true, 1, "N.m/rad",
     "rotational nodal stiffness, slaves included"},
    {"slave", "f", "slave.f", false, 3, "N", "external force on the slave"},
    {"slave", "t", "slave.t", false, 3, "N.m", "external moment on the slave"},
    {"slave", "v", "slave.v", false, 3, "m/s", "velocity"},
    {"slave", "w", "slave.w", false, 3, "rad/s", "angular velocity"},
    {"slave", "r", "slave.r", true, 3, "m", "position"},
    {"slave", "a", "slave.a", true, 3, "m/s2", "acceleration"},
    {"slave", "mass", "slave.mass", true, 1, "kg", "mass of the slave"},
    {"slave", "inertia", "slave.inertia", true, 1, "kg.m2", "rotary inertia of the slave"},
    {"point", "v", "point.v", false, 3, "m/s", "velocity"},
    {"point", "w", "point.w", false, 3, "rad/s", "angular velocity"},
    {"point", "f_ext", "point.f_ext", false, 3, "N", "external force on the node"},
    {"point", "t_ext", "point.t_ext", false, 3, "N.m", "external moment on the node"},
    {"point", "r", "point.r", true, 3, "m", "position"},
    {"port", "v", "port.v", false, 3, "m/s", "velocity of the reference point"},
    {"port", "w", "port.w", false, 3, "rad/s", "angular velocity"},
    {"port", "a", "port.a", false, 3, "m/s2", "acceleration of the reference point"},
    {"port", "z", "port.z", false, 3, "rad/s2", "angular acceleration"},
    {"port", "f", "port.f", false, 3, "N", "resultant force"},
    {"port", "t", "port.t", false, 3, "N.m", "resultant moment about the reference point"},
    {"port", "r", "port.r", true, 3, "m", "position of the reference point"},
};

bool contains(const std::vector<std::string>& list, std::string_view name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

bool isDriven(int group) {
  return group == rotatingDrivenMaster || group == rotatingDrivenPoint || group == drivenMaster || group == drivenPoint;
}
bool isFree(int group) { return group >= rotatingFreeMaster && group <= freePoint; }
bool isRotating(int group) { return group < freeMaster; }

class Table {
 public:
  Table(const Model& m, const Layout& l)
      : model(m),
        layout(l),
        nodeInPort(static_cast<std::size_t>(m.nodes())),
        slaveInPort(static_cast<std::size_t>(m.slaves())) {
    for (const Port& port : model.ports)
      for (int k : port.member) (port.ofSlaves ? slaveInPort : nodeInPort)[static_cast<std::size_t>(k)] = 1;
  }

  // Nodes [first, last) of one group. Those of a port have no variables, nor have its slaves.
  void nodes(int first, int last, bool master, std::string_view name, Field field, Causality causality) {
    eachRun(nodeInPort, first, last, [&](int begin, int end) {
      add(master ? "master" : "point", name, field, causality, begin, end, model.nodeNumber, model.nodeId);
    });
  }
  // Slaves [0, last).
  void slaves(int last, std::string_view name, Field field, Causality causality) {
    eachRun(slaveInPort, 0, last, [&](int begin, int end) {
      add("slave", name, field, causality, begin, end, model.slaveNumber, model.slaveId);
    });
  }
  // Ports of driven nodes or of slaves, which stand at `index` of the field and on.
  void ports(bool ofSlaves, std::string_view name, Field field, Causality causality, int index = 0) {
    std::vector<int> numbers(static_cast<std::size_t>(index));
    std::vector<std::int64_t> ids(numbers.begin(), numbers.end());
    std::vector<std::string> labels;
    for (const Port& port : model.ports)
      if (port.ofSlaves == ofSlaves) {
        numbers.push_back(port.number);
        ids.push_back(port.number);
        labels.push_back(port.name);
      }
    const std::size_t before = blocks.size();
    add("port", name, field, causality, index, static_cast<int>(numbers.size()), numbers, ids);
    if (blocks.size() > before) blocks.back().labels = std::move(labels);
  }
  // Entry `index` of a field without nodes.
  void scalar(std::string_view name, Field field, Causality causality, int index = 0) {
    static const std::vector<int> none;
    static const std::vector<std::int64_t> noIds;
    add("", name, field, causality, index, index + 1, none, noIds);
  }

  std::vector<Block> finish() {
    std::stable_sort(blocks.begin(), blocks.end(), [](const Block& a, const Block& b) { return a.place < b.place; });
    std::uint32_t next = 0;
    for (Block& b : blocks) {
      b.reference = next;
      next += static_cast<std::uint32_t>(b.count());
    }
    return std::move(blocks);
  }

 private:
  template <class Body> static void eachRun(const std::vector<std::uint8_t>& without, int first, int last, Body body) {
    for (int i = first; i < last;) {
      int end = i;
      while (end < last && !without[static_cast<std::size_t>(end)]) ++end;
      body(i, end);
      i = end + 1;
    }
  }

  void add(std::string_view prefix, std::string_view name, Field field, Causality causality, int first, int last,
           const std::vector<int>& numbers, const std::vector<std::int64_t>& ids) {
    if (first == last) return;
    const Row& row = *std::find_if(std::begin(rows), std::end(rows),
                                   [&](const Row& r) { return r.prefix == prefix && r.name == name; });
    // A driven master's position is an input by `position`, and an extra only where it is an output.
    const bool wanted = row.extra || (name == "r" && causality == Causality::output)
                            ? contains(model.settings.expose, row.listed)
                            : true;
    if (!wanted || contains(model.settings.hide, row.listed)) return;
    Block b;
    b.prefix = prefix;
    b.name = name;
    b.components = row.components;
    b.causality = causality;
    b.unit = row.unit;
    b.description = row.description;
    b.field = field;
    b.place = layout[field].offset + static_cast<std::size_t>(first) * row.components;
    if (prefix.empty()) {
      b.numbers = {0};
      b.ids = {0};
    } else {
      b.numbers.assign(numbers.begin() + first, numbers.begin() + last);
      b.ids.assign(ids.begin() + first, ids.begin() + last);
    }
    blocks.push_back(std::move(b));
  }

  const Model& model;
  const Layout& layout;
  std::vector<std::uint8_t> nodeInPort, slaveInPort;
  std::vector<Block> blocks;
};

// Independent nodes that get a moment from a tie: corners of segments whose slaves follow the masters' rotation.
std::vector<char> nodesWithMoment(const Model& model) {
  std::vector<char> has(static_cast<std::size_t>(model.nodes()), 0);
  for (const TieGroup& g : model.groups)
    if (g.coupling == Coupling::rotation)
      for (int node : g.node) has[static_cast<std::size_t>(node)] = 1;
  return has;
}

void addNodes(Table& table, const Model& model) {
  const Settings& s = model.settings;
  const std::vector<char> moment = nodesWithMoment(model);
  for (int group = 0; group < nodeGroups; ++group) {
    const int first = model.begin[group], last = model.begin[group + 1];
    const bool master = model.isMaster(group), rotating = isRotating(group);
    const bool driven = isDriven(group), free = isFree(group);
    const auto add = [&](std::string_view name, Field field, Causality causality) {
      table.nodes(first, last, master, name, field, causality);
    };
    const Causality motion = driven ? Causality::input : Causality::output;

    if (driven || free) {
      add("v", Field::velocity, motion);
      if (rotating) add("w", Field::spin, motion);
      if (driven && master && s.position == Position::input)
        add("r", Field::position, Causality::input);
      else
        add("r", Field::position, Causality::output);
    }
    if (driven && master && model.accelerationInputs()) {
      add("a", Field::acceleration, Causality::input);
      if (rotating) add("z", Field::angularAcceleration, Causality::input);
    }
    if (free) {
      add("f_ext", Field::nodeForce, Causality::input);
      if (rotating) add("t_ext", Field::nodeMoment, Causality::input);
    }
    if (master && (driven || free)) {
      add("added_mass", Field::addedMass, Causality::calculatedParameter);
      add("stiffness", Field::stiffness, Causality::calculatedParameter);
      if (rotating) {
        add("added_inertia", Field::addedInertia, Causality::calculatedParameter);
        add("rotational_stiffness", Field::rotationalStiffness, Causality::calculatedParameter);
      }
    }
    if (master) {
      add("f", Field::reactionForce, Causality::output);
      for (int i = first; i < last;) {  // one block for each run of nodes with a moment
        int end = i;
        while (end < last && moment[static_cast<std::size_t>(end)]) ++end;
        table.nodes(i, end, true, "t", Field::reactionMoment, Causality::output);
        i = end + 1;
      }
    }
  }
}

void addSlaves(Table& table, const Model& model) {
  const int all = model.slaves(), turning = model.turning();
  table.slaves(all, "f", Field::slaveForce, Causality::input);
  table.slaves(turning, "t", Field::slaveMoment, Causality::input);
  table.slaves(all, "v", Field::slaveVelocity, Causality::output);
  table.slaves(turning, "w", Field::slaveSpin, Causality::output);
  table.slaves(all, "r", Field::slavePosition, Causality::output);
  table.slaves(all, "a", Field::slaveAcceleration, Causality::output);
  table.slaves(all, "mass", Field::slaveMass, Causality::parameter);
  table.slaves(turning, "inertia", Field::slaveInertia, Causality::parameter);
}

void addScalars(Table& table, const Model& model) {
  if (model.anyFree()) {
    table.scalar("integrator.time_step", Field::timeStep, Causality::parameter);
    table.scalar("integrator.safety", Field::safety, Causality::parameter);
  }
  if (model.settings.threads > 0) table.scalar("integrator.threads", Field::threads, Causality::parameter);
  if (model.anyFree()) {
    table.scalar("stable_time_step", Field::stableTimeStep, Causality::output);
    table.scalar("nodal_time_step", Field::nodalTimeStep, Causality::output);
  }
  int i = 0;
  for (const char* name :
       {"energy.kinetic", "energy.strain", "energy.dissipated", "energy.external", "energy.residual"})
    table.scalar(name, Field::energy, Causality::output, i++);
  table.scalar("power_residual", Field::powerResidual, Causality::output);
  table.scalar("drift", Field::drift, Causality::output);
}

void addPorts(Table& table, const Model& model) {
  table.ports(false, "v", Field::portVelocity, Causality::input);
  table.ports(false, "w", Field::portSpin, Causality::input);
  if (model.accelerationInputs()) {
    table.ports(false, "a", Field::portAcceleration, Causality::input);
    table.ports(false, "z", Field::portAngularAcceleration, Causality::input);
  }
  table.ports(false, "f", Field::portReaction, Causality::output);
  table.ports(false, "t", Field::portReactionMoment, Causality::output);
  table.ports(true, "f", Field::portForce, Causality::input);
  table.ports(true, "t", Field::portMoment, Causality::input);
  table.ports(true, "v", Field::portMeanVelocity, Causality::output);
  table.ports(true, "w", Field::portMeanSpin, Causality::output);
  table.ports(false, "r", Field::portPosition, Causality::output);
  table.ports(true, "r", Field::portPosition, Causality::output, static_cast<int>(model.drivenPorts()));
}

void checkNames(const std::vector<std::string>& names, const char* table, bool extrasOnly, bool ports) {
  for (const std::string& name : names) {
    std::string known;
    std::string_view last;
    bool found = false;
    for (const Row& r : rows) {
      const bool listed = !extrasOnly || r.extra || r.listed == "master.r";
      if (!listed || r.listed == last) continue;
      last = r.listed;
      found = found || r.listed == name;
      if (r.prefix != "port" || ports) known += (known.empty() ? "" : ", ") + std::string(r.listed);
    }
    if (!found) throw SceneError(std::string("interface: ") + table + ": unknown name '" + name + "'; known: " + known);
  }
}

}  // namespace

std::vector<Block> variables(const Model& model, const Layout& layout) {
  Table table(model, layout);
  addScalars(table, model);
  addNodes(table, model);
  addSlaves(table, model);
  addPorts(table, model);
  return table.finish();
}

std::string variableName(const Block& block, std::size_t element, int component) {
  if (block.prefix.empty()) return block.name;
  std::string name = block.prefix + "[";
  name += block.labels.empty() ? std::to_string(block.numbers[element]) : block.labels[element];
  name += "]." + block.name;
  if (block.components > 1) name += "[" + std::to_string(component + 1) + "]";
  return name;
}

void checkInterface(const Scene& scene) {
  checkNames(scene.settings.expose, "expose", true, !scene.ports.empty());
  checkNames(scene.settings.hide, "hide", false, !scene.ports.empty());
}

}  // namespace tiefmu
