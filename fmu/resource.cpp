#include "resource.hpp"

#include <algorithm>
#include <cereal/archives/portable_binary.hpp>
#include <sstream>
#include <tuple>
#include <type_traits>

#include "bytes.hpp"

namespace tiefmu {
namespace {

constexpr std::string_view magic = "tiefmu scene\n";
constexpr std::uint32_t formatVersion = 6;  // raise it whenever a `field` changes
constexpr std::size_t headerSize = magic.size() + 4 + 8 + 8;

// FNV-1a, 64 bit: against damage in transport, not against intent.
std::uint64_t checksum(std::string_view bytes) {
  std::uint64_t hash = 14695981039346656037u;
  for (unsigned char c : bytes) hash = (hash ^ c) * 1099511628211u;
  return hash;
}

class Writer {
 public:
  explicit Writer(std::ostream& stream)
      : archive(stream, cereal::PortableBinaryOutputArchive::Options::LittleEndian()) {}
  template <class T> void number(const T& value) { archive(value); }
  // `+values`, no lvalue: of one cereal takes the size of the pointer for that of a number.
  template <class T> void numbers(const T* values, std::size_t count) {
    archive(cereal::binary_data(+values, count * sizeof(T)));
  }
  std::size_t size(std::size_t count) {
    archive(static_cast<std::uint64_t>(count));
    return count;
  }

 private:
  cereal::PortableBinaryOutputArchive archive;
};

class Reader {
 public:
  explicit Reader(std::string_view bytes) : view(bytes), stream(&view), archive(stream) {}
  template <class T> void number(T& value) { archive(value); }
  template <class T> void numbers(T* values, std::size_t count) {
    archive(cereal::binary_data(+values, count * sizeof(T)));
  }
  // Count of elements of at least `bytesEach`; refused before anything is allocated for it.
  std::size_t size(std::size_t, std::size_t bytesEach) {
    std::uint64_t count = 0;
    archive(count);
    if (count > view.left() / bytesEach) throw ResourceError("scene: an array is longer than the file");
    return static_cast<std::size_t>(count);
  }
  bool atEnd() const { return view.left() == 0; }

 private:
  View view;
  std::istream stream;
  cereal::PortableBinaryInputArchive archive;
};

// `field` lists what is stored, once for both directions: with a Writer the values are only read. A structure is taken
// apart into all its members, so that one that is forgotten here does not compile.

template <class Archive, class T>
  requires std::is_arithmetic_v<T>
void field(Archive& a, T& value) {
  a.number(value);
}

template <class Archive, class E>
  requires std::is_enum_v<E>
void field(Archive& a, E& value) {
  auto number = static_cast<std::underlying_type_t<E>>(value);
  a.number(number);
  value = static_cast<E>(number);  // its range is checked by checkModel
}

template <class Archive> void field(Archive& a, Vec3& value) { a.numbers(value.data(), 3); }

template <class Archive> std::size_t length(Archive& a, std::size_t count, std::size_t bytesEach) {
  if constexpr (std::is_same_v<Archive, Reader>)
    return a.size(count, bytesEach);
  else
    return a.size(count);
}

template <class Archive> void field(Archive& a, std::string& text) {
  text.resize(length(a, text.size(), 1));
  a.numbers(text.data(), text.size());
}

template <class Archive> void field(Archive& a, SpringEnd& end);
template <class Archive> void field(Archive& a, Spring& spring);
template <class Archive> void field(Archive& a, TieGroup& group);
template <class Archive> void field(Archive& a, Port& port);
template <class Archive> void field(Archive& a, Finding& finding);

template <class Archive, class T> void field(Archive& a, std::vector<T>& values) {
  if constexpr (std::is_arithmetic_v<T>) {
    values.resize(length(a, values.size(), sizeof(T)));
    a.numbers(values.data(), values.size());
  } else {
    values.resize(length(a, values.size(), 8));  // every structure is at least a length or two integers
    for (T& value : values) field(a, value);
  }
}

template <class Archive> void fields(Archive& a, auto&... values) { (field(a, values), ...); }

template <class Archive> void field(Archive& a, SpringEnd& end) {
  auto& [node, slave, orientation] = end;
  fields(a, node, slave, orientation);
}

template <class Archive> void field(Archive& a, Spring& spring) {
  auto& [end, other, kind, stiffness, damping, rotationalStiffness, rotationalDamping, arm, anchor, length, along,
         across] = spring;
  fields(a, end, other, kind, stiffness, damping, rotationalStiffness, rotationalDamping, arm, anchor, length, along,
         across);
}

template <class Archive> void field(Archive& a, TieGroup& group) {
  auto& [coupling, corners, firstSlave, node, begin, weight, partEnd, phaseEnd] = group;
  fields(a, coupling, corners, firstSlave, node, begin, weight, partEnd, phaseEnd);
}

template <class Archive> void field(Archive& a, Port& port) {
  auto& [name, number, ofSlaves, member, arm, place, lever, velocity, spin, turnWeight, orientation] = port;
  fields(a, name, number, ofSlaves, member, arm, place, lever, velocity, spin, turnWeight, orientation);
}

template <class Archive> void field(Archive& a, Finding& finding) {
  auto& [kind, text] = finding;
  int number = kind;
  field(a, number);
  kind = number == Finding::warning ? Finding::warning : Finding::note;
  field(a, text);
}

template <class Archive> void field(Archive& a, Settings& s) {
  std::apply([&](const auto&... m) { (field(a, s.*m.member), ...); }, settingsMembers);
}

// Everything of a model but its tie report: an instance computes with all of it and shows none of that.
template <class Archive> void field(Archive& a, Model& model) {
  auto& [settings, begin, nodeId, nodeNumber, nodePosition, nodeVelocity, nodeSpin, nodeMass, nodeInertia,
         nodeStiffness, nodeRotationalStiffness, slaveId, slaveNumber, slaveOffset, slaveMass, slaveInertia,
         slaveStiffness, slaveRotationalStiffness, turningSlaves, groups, springs, oriented, ports, tieName,
         searchDistance, slaveReport, findings, dropped, leftOut] = model;
  field(a, settings);
  for (int& first : begin) field(a, first);
  fields(a, nodeId, nodeNumber, nodePosition, nodeVelocity, nodeSpin, nodeMass, nodeInertia, nodeStiffness,
         nodeRotationalStiffness);
  fields(a, slaveId, slaveNumber, slaveOffset, slaveMass, slaveInertia, slaveStiffness, slaveRotationalStiffness);
  fields(a, turningSlaves, groups, springs, oriented, ports, tieName, findings);
}

void require(bool truth, const char* what) {
  if (!truth) throw ResourceError(std::string("scene: the model contradicts itself: ") + what);
}

template <class T> void requireSize(const std::vector<T>& values, std::size_t count, const char* what) {
  require(values.size() == count, what);
}

void requireFinite(const std::vector<double>& values, const char* what) {
  for (double v : values) require(std::isfinite(v), what);
}

template <class E> void requireEnum(E value, const char* what) {
  require(static_cast<std::size_t>(value) < words<E>.size(), what);
}

void checkSettings(const Settings& s) {
  const auto check = [&]<class T>(const SettingsMember<T>& m) {
    if constexpr (std::is_enum_v<T>) requireEnum(s.*m.member, m.key);
    if constexpr (std::is_same_v<T, double>) require(std::isfinite(s.*m.member), m.key);
    if constexpr (std::is_same_v<T, Vec3>) require((s.*m.member).allFinite(), m.key);
  };
  std::apply([&](const auto&... m) { (check(m), ...); }, settingsMembers);
  require(s.threads >= 0 && s.threads <= mostThreads, "threads");
  require(s.reactionLead >= 0 && s.reactionLead <= 1, "reaction lead");
  require(s.reactionLead == 0 || s.reaction != Reaction::loads, "reaction lead");
  require(s.solverTolerance > 0 && s.solverTolerance < 1, "solver tolerance");
}

void checkNodes(const Model& m) {
  require(m.begin[0] == 0, "node groups");
  for (int g = 0; g < nodeGroups; ++g) require(m.begin[g] <= m.begin[g + 1], "node groups");
  const auto nodes = static_cast<std::size_t>(m.nodes()), rotating = static_cast<std::size_t>(m.rotating());
  requireSize(m.nodeId, nodes, "node ids");
  requireSize(m.nodeNumber, nodes, "node numbers");
  requireSize(m.nodePosition, 3 * nodes, "node positions");
  requireSize(m.nodeVelocity, 3 * nodes, "node velocities");
  requireSize(m.nodeSpin, 3 * rotating, "node spins");
  requireSize(m.nodeMass, nodes, "node masses");
  requireSize(m.nodeInertia, nodes, "node inertias");
  requireSize(m.nodeStiffness, nodes, "node stiffnesses");
  requireSize(m.nodeRotationalStiffness, nodes, "rotational node stiffnesses");
  for (const auto* v : {&m.nodePosition, &m.nodeVelocity, &m.nodeSpin, &m.nodeMass, &m.nodeInertia, &m.nodeStiffness,
                        &m.nodeRotationalStiffness})
    requireFinite(*v, "node numbers that are not finite");
  for (int number : m.nodeNumber) require(number >= 1, "node numbers");
}

void checkSlaves(const Model& m) {
  const std::size_t slaves = m.slaveId.size();
  require(slaves < (std::size_t{1} << 31), "number of slaves");
  require(m.turningSlaves >= 0 && static_cast<std::size_t>(m.turningSlaves) <= slaves, "turning slaves");
  requireSize(m.slaveNumber, slaves, "slave numbers");
  requireSize(m.slaveOffset, 3 * slaves, "slave offsets");
  requireSize(m.slaveMass, slaves, "slave masses");
  requireSize(m.slaveInertia, slaves, "slave inertias");
  if (!m.slaveStiffness.empty()) requireSize(m.slaveStiffness, slaves, "slave stiffnesses");
  if (!m.slaveRotationalStiffness.empty())
    requireSize(m.slaveRotationalStiffness, slaves, "rotational slave stiffnesses");
  for (const auto* v : {&m.slaveOffset, &m.slaveMass, &m.slaveInertia, &m.slaveStiffness, &m.slaveRotationalStiffness})
    requireFinite(*v, "slave numbers that are not finite");
  for (int number : m.slaveNumber) require(number >= 1, "slave numbers");
}

void checkGroups(const Model& m) {
  std::size_t next = 0;
  for (const TieGroup& g : m.groups) {
    requireEnum(g.coupling, "coupling");
    require(g.corners == 3 || g.corners == 4, "corners of a segment");
    require(g.firstSlave >= 0 && static_cast<std::size_t>(g.firstSlave) == next, "slave groups");
    require(!g.begin.empty() && g.begin.front() == 0, "segments");
    for (std::size_t e = 1; e < g.begin.size(); ++e) require(g.begin[e - 1] <= g.begin[e], "segments");
    const std::size_t corners = g.corners, segments = g.begin.size() - 1, slaves = g.begin.back();
    requireSize(g.node, corners * segments, "corners of segments");
    requireSize(g.weight, corners * slaves, "weights");
    requireFinite(g.weight, "weights that are not finite");
    require(!g.partEnd.empty() && std::is_sorted(g.partEnd.begin(), g.partEnd.end()) && g.partEnd.front() >= 0 &&
                g.partEnd.back() == g.segments(),
            "parts");
    require(!g.phaseEnd.empty() && std::is_sorted(g.phaseEnd.begin(), g.phaseEnd.end()) && g.phaseEnd.front() >= 0 &&
                static_cast<std::size_t>(g.phaseEnd.back()) == g.partEnd.size(),
            "phases");
    const int nodes = kinematicsOf(g.coupling).mastersTurn ? m.rotating() : m.nodes();
    for (int node : g.node) require(node >= 0 && node < nodes, "corners of segments");
    next += slaves;
    const bool turns = kinematicsOf(g.coupling).slavesTurn;
    require(slaves == 0 || turns == (next <= static_cast<std::size_t>(m.turningSlaves)), "turning slaves");
  }
  require(next == m.slaveId.size(), "slave groups");
}

// Quaternions: of meanMotion segments, then of `oriented`.
std::size_t rotations(const Model& m) {
  std::size_t count = m.oriented.size();
  for (const TieGroup& g : m.groups)
    if (kinematicsOf(g.coupling).segmentsTurn) count += g.begin.size() - 1;
  return count;
}

void checkSprings(const Model& m) {
  const int orientations = static_cast<int>(rotations(m));
  const auto checkEnd = [&](const SpringEnd& e) {
    require(e.node >= -1 && e.node < m.nodes() && e.slave >= -1 && e.slave < m.slaves(), "ends of springs");
    require(e.node < 0 || e.slave < 0, "ends of springs");
    require(e.orientation >= -1 && e.orientation < orientations, "ends of springs");
  };
  for (const Spring& s : m.springs) {
    checkEnd(s.a);
    checkEnd(s.b);
    requireEnum(s.kind, "kind of spring");
    for (const Vec3* v : {&s.stiffness, &s.damping, &s.rotationalStiffness, &s.rotationalDamping, &s.arm, &s.anchor,
                          &s.along, &s.across})
      require(v->allFinite(), "springs");
    require(std::isfinite(s.length), "springs");
  }
  for (const SpringEnd& e : m.oriented) {
    checkEnd(e);
    require(e.node < m.rotating() && e.slave < m.turning(), "ends of springs");
  }
}

void checkPorts(const Model& m) {
  require(m.ports.empty() || m.settings.position == Position::integrated, "ports");
  std::vector<std::uint8_t> ofPort[2] = {std::vector<std::uint8_t>(static_cast<std::size_t>(m.nodes())),
                                         std::vector<std::uint8_t>(m.slaveId.size())};
  const int orientations = static_cast<int>(rotations(m));
  std::uint8_t slavesBefore = 0;
  for (const Port& p : m.ports) {
    require(p.ofSlaves <= 1 && p.ofSlaves >= slavesBefore, "ports");
    slavesBefore = p.ofSlaves;
    require(p.number >= 1 && !p.name.empty() && !p.member.empty(), "ports");
    requireSize(p.arm, 3 * p.member.size(), "arms of ports");
    requireFinite(p.arm, "arms of ports");
    for (const Vec3* v : {&p.place, &p.lever, &p.velocity, &p.spin}) require(v->allFinite(), "ports");
    require(std::isfinite(p.turnWeight) && p.turnWeight >= 0, "ports");
    for (int k : p.member) {
      auto& taken = ofPort[p.ofSlaves];
      const auto place = static_cast<std::size_t>(k);
      require(k >= 0 && place < taken.size() && !taken[place], "nodes of ports");
      taken[place] = 1;
      const bool fixedOrFree = k >= m.begin[rotatingFixedMaster] && k < m.begin[drivenMaster];
      require(p.ofSlaves || !fixedOrFree, "nodes of ports");
    }
    if (!p.orientation.empty()) requireSize(p.orientation, p.member.size(), "rotations of ports");
    for (int k : p.orientation) require(k >= -1 && k < orientations, "rotations of ports");
  }
}

}  // namespace

void checkModel(const Model& model) {
  checkSettings(model.settings);
  checkNodes(model);
  checkSlaves(model);
  checkGroups(model);
  checkSprings(model);
  checkPorts(model);
}

std::string writeResource(const Model& model, const std::string& guid) {
  std::ostringstream stream;
  Resource copy{model, guid};  // `field` takes no constants, because it also reads
  {
    Writer writer(stream);
    field(writer, copy.guid);
    field(writer, copy.model);
  }
  const std::string body = std::move(stream).str();
  std::string out;
  out.reserve(headerSize + body.size());
  out += magic;
  putNumber(out, formatVersion, 4);
  putNumber(out, body.size(), 8);
  putNumber(out, checksum(body), 8);
  return out += body;
}

Resource readResource(std::string_view bytes) {
  if (bytes.substr(0, magic.size()) != magic) throw ResourceError("scene: not a scene of tiefmu");
  if (bytes.size() < headerSize) throw ResourceError("scene: cut short");
  bytes.remove_prefix(magic.size());
  const auto version = takeNumber(bytes, 4);
  if (version != formatVersion)
    throw ResourceError("scene: format version " + std::to_string(version) + ", this program reads version " +
                        std::to_string(formatVersion));
  const auto size = takeNumber(bytes, 8), sum = takeNumber(bytes, 8);
  if (checksums && size != bytes.size())
    throw ResourceError("scene: " + std::to_string(bytes.size()) + " bytes instead of " + std::to_string(size));
  if (checksums && sum != checksum(bytes)) throw ResourceError("scene: damaged (checksum)");
  try {
    Reader reader(bytes);
    Resource resource;
    field(reader, resource.guid);
    field(reader, resource.model);
    if (!reader.atEnd()) throw ResourceError("scene: bytes left over");
    checkModel(resource.model);
    return resource;
  } catch (const cereal::Exception&) {
    throw ResourceError("scene: cut short");
  }
}

}  // namespace tiefmu
