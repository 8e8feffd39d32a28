#include "dependencies.hpp"

#include <algorithm>
#include <numeric>

#include "influences.hpp"

namespace tiefmu {
namespace {

// Beyond these an unknown is taken to depend on everything: lists of that length help no importer.
constexpr std::size_t mostEntriesPerRow = 5000;
constexpr std::size_t mostEntriesPerClass = 1000000;  // unknowns of a class times their knowns
// So is one that depends on nearly everything: an absent list says so (FMI 2.0.4, 2.2.8).
constexpr std::size_t longRow = 1000;
constexpr double nearlyAll = 0.9;

Dependence kindOf(Pattern p, int bit) {
  return p.moving >> bit & 1 ? Dependence::dependent : p.changing >> bit & 1 ? Dependence::fixed : Dependence::constant;
}

class Analysis {
 public:
  Analysis(const Model& m, const std::vector<Block>& table)
      : model(m), blocks(table), layout(m), influences(m, layout, table), references(influences.references()) {}
  Dependencies run();

 private:
  std::uint32_t root(std::uint32_t freedom);
  void couple(const Influences::Pair& pair);
  void numberClasses();
  void findClasses();

  void startRow();
  void addDependency(std::uint32_t reference, Dependence kind);
  void collect(const List& list, int component, Dependence least, bool acrossClasses);
  void finishRow();
  void rows(const Block& block);
  void vectorRows(const Block& block, const auto& collectLists);
  void nodeRows(const Block& block, const auto& lists);
  void slaveRows(const Block& block, const auto& list);
  void portRows(const Block& block, const auto& list);
  void uniformRows(const Block& block, bool all);

  const Model& model;
  const std::vector<Block>& blocks;
  const Layout layout;
  const Influences influences;
  const std::uint32_t references;
  std::size_t inputs = 0;

  // Accelerations that a mass matrix couples form a class: they depend on the same knowns.
  std::vector<std::uint32_t> parent;                          // union-find over 6 freedoms of each free node
  std::vector<Dependence> leastKind;                          // per freedom: how its row of the mass matrix changes
  std::vector<std::uint32_t> classOf, members, membersBegin;  // freedoms by class
  std::vector<Dependency> knowns;                             // of class c: [knownsBegin[c], knownsBegin[c+1])
  std::vector<std::size_t> knownsBegin;
  std::vector<std::uint8_t> isDense;  // its list is left out

  Dependencies out;
  std::vector<Dependency> row;  // being collected
  bool rowIsAll = false;
  std::uint32_t stamp = 0;
  std::vector<std::uint32_t> stampOf, placeOf;  // per reference: last row that holds it, and where
  std::vector<std::uint32_t> classStamp;        // per class: last row that holds it, and as what
  std::vector<Dependence> classKind;
};

std::uint32_t Analysis::root(std::uint32_t freedom) {
  while (parent[freedom] != freedom) freedom = parent[freedom] = parent[parent[freedom]];
  return freedom;
}

// Freedoms of two free nodes that the mass matrix couples find their accelerations together.
void Analysis::couple(const Influences::Pair& pair) {
  const auto rowBase = 6 * static_cast<std::uint32_t>(pair.node - model.freeBegin());
  const auto columnBase = 6 * static_cast<std::uint32_t>(pair.other - model.freeBegin());
  const Pattern* block[2][2] = {{&pair.mass.vv, &pair.mass.vw}, {&pair.mass.wv, &pair.mass.ww}};
  for (std::uint32_t i = 0; i < 6; ++i)
    for (std::uint32_t j = 0; j < 6; ++j) {
      const Pattern& p = *block[i / 3][j / 3];
      const int bit = static_cast<int>(3 * (i % 3) + j % 3);
      if (!(p.any >> bit & 1)) continue;
      parent[root(rowBase + i)] = root(columnBase + j);
      leastKind[rowBase + i] = std::max(leastKind[rowBase + i], kindOf(p, bit));
    }
}

void Analysis::numberClasses() {
  const auto freedoms = 6 * static_cast<std::uint32_t>(model.free());
  parent.resize(freedoms);
  std::iota(parent.begin(), parent.end(), 0u);
  leastKind.assign(freedoms, Dependence::constant);
  for (const Influences::Pair& pair : influences.coupled) couple(pair);
  classOf.resize(freedoms);
  std::uint32_t classes = 0;
  for (std::uint32_t k = 0; k < freedoms; ++k)
    if (root(k) == k) classOf[k] = classes++;
  membersBegin.assign(classes + 1, 0);
  for (std::uint32_t k = 0; k < freedoms; ++k) ++membersBegin[(classOf[k] = classOf[root(k)]) + 1];
  std::partial_sum(membersBegin.begin(), membersBegin.end(), membersBegin.begin());
  members.resize(freedoms);
  std::vector<std::uint32_t> next = membersBegin;
  for (std::uint32_t k = 0; k < freedoms; ++k) members[next[classOf[k]]++] = k;
}

// The knowns of every class: those of all loads on its freedoms.
void Analysis::findClasses() {
  numberClasses();
  const std::size_t classes = membersBegin.size() - 1;
  knownsBegin.assign(1, 0);
  for (std::size_t c = 0; c < classes; ++c) {
    const auto first = members.begin() + membersBegin[c], last = members.begin() + membersBegin[c + 1];
    Dependence least = Dependence::constant;
    for (auto k = first; k < last; ++k) least = std::max(least, leastKind[*k]);
    startRow();
    for (auto k = first; k < last; ++k) {
      const int node = model.freeBegin() + static_cast<int>(*k / 6), component = static_cast<int>(*k % 3);
      const bool turn = *k % 6 >= 3;
      collect(turn ? influences.nodeMoment[node] : influences.nodeForce[node], component, least, false);
      collect(turn ? influences.reactionMoment[node] : influences.reactionForce[node], component, least, false);
      collect(turn ? influences.inertialMoment[node] : influences.inertialForce[node], component, least, false);
    }
    const auto unknowns = static_cast<std::size_t>(last - first);
    isDense.push_back(row.size() > mostEntriesPerRow || row.size() * unknowns > mostEntriesPerClass);
    if (!isDense.back()) knowns.insert(knowns.end(), row.begin(), row.end());
    knownsBegin.push_back(knowns.size());
  }
  classStamp.assign(classes, 0);
  classKind.resize(classes);
}

void Analysis::startRow() {
  row.clear();
  rowIsAll = false;
  ++stamp;
}

void Analysis::addDependency(std::uint32_t reference, Dependence kind) {
  if (stampOf[reference] != stamp) {
    stampOf[reference] = stamp;
    placeOf[reference] = static_cast<std::uint32_t>(row.size());
    row.push_back({reference, kind});
  } else {
    Dependence& held = row[placeOf[reference]].kind;
    held = std::max(held, kind);
  }
}

// Adds one component of an unknown vector to the row. Accelerations of free nodes stand for the knowns of their class.
void Analysis::collect(const List& list, int component, Dependence least, bool acrossClasses) {
  for (const Entry& e : list)
    for (int c = 0; c < 3; ++c) {
      const int bit = 3 * component + c;
      if (!(e.pattern.any >> bit & 1)) continue;
      const Dependence kind = std::max(kindOf(e.pattern, bit), least);
      const std::uint32_t reference = e.known + static_cast<std::uint32_t>(c);
      if (reference < references) {
        addDependency(reference, kind);
      } else if (acrossClasses) {
        const std::uint32_t k = classOf[reference - references];
        if (classStamp[k] == stamp && classKind[k] >= kind) continue;
        classStamp[k] = stamp;
        classKind[k] = kind;
        rowIsAll |= isDense[k] != 0;
        for (std::size_t i = knownsBegin[k]; i < knownsBegin[k + 1]; ++i)
          addDependency(knowns[i].reference, std::max(kind, knowns[i].kind));
      }
    }
}

void Analysis::finishRow() {
  const bool dense = row.size() > longRow && static_cast<double>(row.size()) > nearlyAll * static_cast<double>(inputs);
  const bool all = rowIsAll || dense || row.size() > mostEntriesPerRow;
  if (!all) out.entries.insert(out.entries.end(), row.begin(), row.end());
  out.all.push_back(all);
  out.begin.push_back(out.entries.size());
}

// A row for each component of an unknown vector (or a scalar, in component 0).
void Analysis::vectorRows(const Block& block, const auto& collectLists) {
  for (int k = 0; k < block.components; ++k) {
    startRow();
    collectLists([&](const List& list) { collect(list, k, Dependence::constant, true); });
    finishRow();
  }
}

// lists(node, take): calls take with each list of what the node's unknown depends on.
void Analysis::nodeRows(const Block& block, const auto& lists) {
  const int first = static_cast<int>((block.place - layout[block.field].offset) / block.components);
  for (int e = 0; e < static_cast<int>(block.numbers.size()); ++e)
    vectorRows(block, [&](const auto& take) { lists(static_cast<std::size_t>(first + e), take); });
}

// list(segment, slave): what the slave's unknown depends on.
void Analysis::slaveRows(const Block& block, const auto& list) {
  const int first = static_cast<int>((block.place - layout[block.field].offset) / block.components);
  const int last = first + static_cast<int>(block.numbers.size());
  influences.eachSegment([&](const Segment& s) {
    for (int slave = std::max(s.first, first); slave < std::min(s.last, last); ++slave) {
      const List found = list(s, slave);
      vectorRows(block, [&](const auto& take) { take(found); });
    }
  });
}

// list(port): what the port's unknown depends on.
void Analysis::portRows(const Block& block, const auto& list) {
  for (std::size_t port = 0; port < block.numbers.size(); ++port) {
    const List found = list(port);
    vectorRows(block, [&](const auto& take) { take(found); });
  }
}

void Analysis::uniformRows(const Block& block, bool all) {
  for (std::size_t i = 0; i < block.count(); ++i) {
    startRow();
    rowIsAll = all;
    finishRow();
  }
}

void Analysis::rows(const Block& block) {
  if (block.causality == Causality::input || block.causality == Causality::parameter) return uniformRows(block, false);
  const bool inertial = model.settings.reaction != Reaction::loads;
  const auto motion = [&](List Influences::Motion::* part) {
    return [this, part](const Segment& s, int slave) { return influences.motion(s, slave).*part; };
  };
  switch (block.dependsOn) {
    case DependsOn::all: return uniformRows(block, true);
    case DependsOn::nothing: return uniformRows(block, false);
    case DependsOn::addedMass:
      return nodeRows(block, [&](std::size_t node, const auto& take) { take(influences.addedMass[node]); });
    case DependsOn::addedInertia:
      return nodeRows(block, [&](std::size_t node, const auto& take) { take(influences.addedInertia[node]); });
    case DependsOn::reactionForce:
      return nodeRows(block, [&](std::size_t node, const auto& take) {
        take(influences.reactionForce[node]);
        if (inertial) take(influences.inertialForce[node]);
      });
    case DependsOn::reactionMoment:
      return nodeRows(block, [&](std::size_t node, const auto& take) {
        take(influences.reactionMoment[node]);
        if (inertial) take(influences.inertialMoment[node]);
      });
    case DependsOn::slaveVelocity: return slaveRows(block, motion(&Influences::Motion::velocity));
    case DependsOn::slaveSpin: return slaveRows(block, motion(&Influences::Motion::spin));
    case DependsOn::slavePosition: return slaveRows(block, motion(&Influences::Motion::position));
    case DependsOn::slaveAcceleration:
      return slaveRows(block, [&](const Segment& s, int slave) { return influences.acceleration(s, slave); });
    case DependsOn::portReaction:
      return portRows(block, [&](std::size_t port) { return influences.resultant(port, inertial).force; });
    case DependsOn::portReactionMoment:
      return portRows(block, [&](std::size_t port) { return influences.resultant(port, inertial).moment; });
    case DependsOn::portMeanVelocity:
      return portRows(block, [&](std::size_t port) { return influences.means[port].force; });
    case DependsOn::portMeanSpin:
      return portRows(block, [&](std::size_t port) { return influences.means[port].moment; });
  }
}

Dependencies Analysis::run() {
  stampOf.assign(references, 0);
  placeOf.resize(references);
  out.begin.push_back(0);
  for (const Block& b : blocks)
    if (b.causality == Causality::input) inputs += b.count();
  findClasses();
  for (const Block& b : blocks) rows(b);
  return std::move(out);
}

}  // namespace

Dependencies dependencies(const Model& model, const std::vector<Block>& blocks) {
  return Analysis(model, blocks).run();
}

}  // namespace tiefmu
