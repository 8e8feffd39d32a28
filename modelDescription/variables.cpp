#include "variables.hpp"

#include <algorithm>

namespace tiefmu {
namespace {

bool isListed(const Variable& variable, const std::vector<std::string>& names) {
  return std::any_of(names.begin(), names.end(), [&](const std::string& name) { return variable.isListedAs(name); });
}

Owner ownerOf(NodeGroup group) {
  switch (group) {
    case rotatingDrivenMaster:
    case drivenMaster: return Owner::drivenMaster;
    case rotatingFreeMaster:
    case freeMaster: return Owner::freeMaster;
    case rotatingFixedMaster:
    case fixedMaster: return Owner::fixedMaster;
    case rotatingDrivenPoint:
    case drivenPoint: return Owner::drivenPoint;
    case rotatingFreePoint:
    case freePoint: return Owner::freePoint;
    case rotatingFixedPoint:
    case fixedPoint:
    case nodeGroups: break;
  }
  return Owner{};
}

class Blocks {
 public:
  Blocks(const Model& m, const Layout& l)
      : model(m),
        layout(l),
        nodeInPort(static_cast<std::size_t>(m.nodes())),
        slaveInPort(static_cast<std::size_t>(m.slaves())),
        withoutMoment(static_cast<std::size_t>(m.nodes()), 1) {
    for (const Port& port : model.ports)
      for (int k : port.member) (port.ofSlaves ? slaveInPort : nodeInPort)[static_cast<std::size_t>(k)] = 1;
    for (const TieGroup& g : model.groups)
      if (kinematicsOf(g.coupling).mastersTurn)
        for (int node : g.node) withoutMoment[static_cast<std::size_t>(node)] = 0;
    for (int node = 0; node < model.nodes(); ++node)
      withoutMoment[static_cast<std::size_t>(node)] |= nodeInPort[static_cast<std::size_t>(node)];
  }

  std::vector<Block> all() {
    for (const Variable& v : variableRows)
      if (layout[v.field].count > 0 && isWanted(v)) add(v);
    std::stable_sort(blocks.begin(), blocks.end(), [](const Block& a, const Block& b) { return a.place < b.place; });
    std::uint32_t next = 0;
    for (Block& b : blocks) {
      b.reference = next;
      next += static_cast<std::uint32_t>(b.count());
    }
    return std::move(blocks);
  }

 private:
  bool isWanted(const Variable& v) const {
    const Settings& s = model.settings;
    if (isListed(v, s.hide)) return false;
    switch (v.shown) {
      case Shown::always:
      case Shown::withMoment: return true;
      case Shown::exposed: return isListed(v, s.expose);
      case Shown::exposedUnlessGiven: return isListed(v, s.expose) && s.position != Position::input;
      case Shown::positionsGiven: return s.position == Position::input;
      case Shown::accelerationsGiven: return model.accelerationInputs();
      case Shown::withFreeNodes: return model.anyFree();
      case Shown::withThreads: return s.threads > 0;
    }
    return false;
  }

  void add(const Variable& v) {
    if (v.owner == Owner::scene) return addBlock(v, v.entry, {0}, {0});
    if (v.owner == Owner::slave) {
      const int last = v.row().per == Per::turningSlave ? model.turning() : model.slaves();
      return addRuns(v, 0, last, slaveInPort, model.slaveNumber, model.slaveId);
    }
    if (overlap(v.owner, Owner::drivenPort)) addPorts(v, false);
    if (overlap(v.owner, Owner::slavePort)) addPorts(v, true);
    for (int group = 0; group < nodeGroups; ++group) {
      if (!overlap(v.owner, ownerOf(static_cast<NodeGroup>(group)))) continue;
      const int limit = v.row().per == Per::rotatingNode ? model.rotating() : model.nodes();
      const int first = model.begin[group], last = std::min(model.begin[group + 1], limit);
      addRuns(v, first, last, v.shown == Shown::withMoment ? withoutMoment : nodeInPort, model.nodeNumber,
              model.nodeId);
    }
  }

  // One block for each run of elements of [first, last) that are not left out.
  void addRuns(const Variable& v, int first, int last, const std::vector<std::uint8_t>& without,
               const std::vector<int>& numbers, const std::vector<std::int64_t>& ids) {
    for (int i = first; i < last;) {
      int end = i;
      while (end < last && !without[static_cast<std::size_t>(end)]) ++end;
      if (end > i) addBlock(v, i, {numbers.begin() + i, numbers.begin() + end}, {ids.begin() + i, ids.begin() + end});
      i = end + 1;
    }
  }

  void addPorts(const Variable& v, bool ofSlaves) {
    std::vector<int> numbers;
    std::vector<std::string> labels;
    for (const Port& port : model.ports)
      if (port.ofSlaves == ofSlaves) {
        numbers.push_back(port.number);
        labels.push_back(port.name);
      }
    if (numbers.empty()) return;
    const int first = ofSlaves && v.row().per == Per::port ? static_cast<int>(model.drivenPorts()) : 0;
    addBlock(v, first, numbers, {numbers.begin(), numbers.end()});
    blocks.back().labels = std::move(labels);
  }

  // first: row (of the scene's fields: entry) of the field.
  void addBlock(const Variable& v, int first, std::vector<int> numbers, std::vector<std::int64_t> ids) {
    const std::size_t place =
        layout[v.field].offset + static_cast<std::size_t>(first) * static_cast<std::size_t>(v.components());
    blocks.push_back({v.prefix(),
                      v.name,
                      v.components(),
                      v.causality,
                      v.row().unit,
                      v.description,
                      v.dependsOn,
                      v.field,
                      place,
                      std::move(numbers),
                      std::move(ids),
                      {},
                      model.settings.names,
                      0});
  }

  const Model& model;
  const Layout& layout;
  std::vector<std::uint8_t> nodeInPort, slaveInPort;
  std::vector<std::uint8_t> withoutMoment;  // or in a port
  std::vector<Block> blocks;
};

std::string listedName(const Variable& v) {
  std::string name(v.group.empty() ? v.prefix() : v.group);
  if (!v.group.empty()) return name;
  if (!name.empty()) name += '.';
  return name += v.name;
}

// master[1].v[3] -> master_1_v_3. Bytes of UTF-8 stay.
std::string flat(const std::string& name) {
  std::string out;
  for (char c : name) {
    const bool stays = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || (c & 0x80) != 0;
    if (c != ']') out += stays ? c : '_';
  }
  return out;
}

// Any two names of variables differ where those of the ports do: what stands before and behind them has no variants.
void checkFlatNames(const std::vector<ScenePort>& ports) {
  for (std::size_t i = 0; i < ports.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (flat(ports[i].name) == flat(ports[j].name))
        throw SceneError("interface: port '" + ports[i].name + "': its flat name is that of port '" + ports[j].name +
                         "'; give it another name");
}

void checkNames(const std::vector<std::string>& names, const char* list, bool extrasOnly, bool ports) {
  for (const std::string& name : names) {
    std::vector<std::string> known;
    bool found = false;
    for (const Variable& v : variableRows) {
      if (extrasOnly && !v.isExtra()) continue;
      found |= v.isListedAs(name);
      if (v.prefix() == "port" && !ports) continue;
      if (std::string text = listedName(v); std::find(known.begin(), known.end(), text) == known.end())
        known.push_back(std::move(text));
    }
    if (found) continue;
    std::string message = std::string("interface: ") + list + ": unknown name '" + name + "'; known: ";
    for (const std::string& text : known) message.append(&text == &known.front() ? "" : ", ").append(text);
    throw SceneError(message);
  }
}

}  // namespace

std::vector<Block> variables(const Model& model, const Layout& layout) { return Blocks(model, layout).all(); }

std::string variableName(const Block& block, std::size_t element, int component) {
  std::string name(block.prefix);
  if (!block.prefix.empty()) {
    name += '[';
    name += block.labels.empty() ? std::to_string(block.numbers[element]) : block.labels[element];
    name += "].";
  }
  name += block.name;
  if (!block.prefix.empty() && block.components > 1) name.append("[").append(std::to_string(component + 1)).append("]");
  return block.names == Names::flat ? flat(name) : name;
}

void checkInterface(const Scene& scene) {
  checkNames(scene.settings.expose, "expose", true, !scene.ports.empty());
  checkNames(scene.settings.hide, "hide", false, !scene.ports.empty());
  if (scene.settings.names == Names::flat) checkFlatNames(scene.ports);
}

}  // namespace tiefmu
