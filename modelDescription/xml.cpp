#include "xml.hpp"

#include <algorithm>
#include <charconv>
#include <memory>
#include <string_view>

#include "../src/host_step.hpp"
#include "dependencies.hpp"
#include "variables.hpp"
#include "xml_text.hpp"

namespace tiefmu {
namespace {

static_assert(std::all_of(std::begin(variableRows), std::end(variableRows),
                          [](const Variable& v) { return isUnit(v.row().unit); }),
              "the unit of a variable is missing here");

// The common validator takes 2 ms for each structured name.
constexpr std::size_t mostStructuredNames = 10000;

double fromText(const std::string& text) {
  double value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

// A thousand steps: of 1 ms, or where the step has a limit, of one substep or of what an explicit host may take, the
// shorter one, rounded down to 1, 2 or 5 times a power of ten.
Experiment defaultExperiment(const Model& model, const Simulation& simulation) {
  double substep =
      model.settings.timeStep > 0 ? model.settings.timeStep : model.settings.safety * simulation.integratorLimit();
  if (!model.anyFree() || substep > 1e6) substep = 1e-3;
  substep = std::min(substep, hostStep(simulation).step);
  char text[32];  // like 9.87e-07; its decimals are exact where those of log10 and pow are not
  const char* end = std::to_chars(text, text + sizeof text, substep, std::chars_format::scientific).ptr;
  const char* e = std::find(static_cast<const char*>(text), end, 'e') + 1;
  int exponent = 0;
  std::from_chars(*e == '+' ? e + 1 : e, end, exponent);
  const char* digit = text[0] >= '5' ? "5e" : text[0] >= '2' ? "2e" : "1e";
  return {fromText(digit + std::to_string(exponent)), fromText(digit + std::to_string(exponent + 3))};
}

struct Place {  // of an element in the listing
  int prefix, number;
  std::uint32_t block, element;
};

// Elements as a person reads them: first what belongs to no node, then ports, masters, slaves, points by number.
std::vector<Place> listing(const std::vector<Block>& blocks) {
  std::vector<Place> places;
  for (std::uint32_t b = 0; b < blocks.size(); ++b) {
    const std::string_view prefix = blocks[b].prefix;
    const int order = prefix.empty() ? 0 : prefix == "port" ? 1 : prefix == "master" ? 2 : prefix == "slave" ? 3 : 4;
    for (std::uint32_t e = 0; e < blocks[b].numbers.size(); ++e) places.push_back({order, blocks[b].numbers[e], b, e});
  }
  // Inputs and outputs stand before parameters, and otherwise in the order of memory.
  const auto rank = [&](const Place& p) {
    const Causality c = blocks[p.block].causality;
    return c == Causality::input ? 0 : c == Causality::output ? 1 : 2;
  };
  std::sort(places.begin(), places.end(), [&](const Place& a, const Place& b) {
    if (a.prefix != b.prefix) return a.prefix < b.prefix;
    if (a.number != b.number) return a.number < b.number;
    if (a.block == b.block) return a.element < b.element;
    const int ra = rank(a), rb = rank(b);
    return ra != rb ? ra < rb : a.block < b.block;
  });
  return places;
}

const char* causalityAttributes(Causality causality) {
  switch (causality) {
    case Causality::parameter: return R"( causality="parameter" variability="fixed")";
    case Causality::calculatedParameter: return R"( causality="calculatedParameter" variability="fixed")";
    case Causality::input: return R"( causality="input")";
    case Causality::output: return R"( causality="output")";
  }
  return "";
}

void appendHead(std::string& out, const std::string& name, const std::string& title, const std::string& guid,
                bool structured) {
  out += "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"2.0\"";
  attribute(out, "modelName", name);
  attribute(out, "guid", guid);
  if (!title.empty()) attribute(out, "description", title);
  attribute(out, "generationTool", "tiefmu " TIEFMU_VERSION);
  attribute(out, "variableNamingConvention", structured ? "structured" : "flat");
  out += ">\n<CoSimulation";
  attribute(out, "modelIdentifier", modelIdentifier(name));
  out += R"( canHandleVariableCommunicationStepSize="true" canInterpolateInputs="true" maxOutputDerivativeOrder="1")"
         R"( canRunAsynchronuously="false" canBeInstantiatedOnlyOncePerProcess="false")"
         R"( canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true")"
         R"( providesDirectionalDerivative="true"/>)"
         "\n";
}

void appendDefinitions(std::string& out) {
  appendUnits(out);
  out += "<TypeDefinitions>\n";
  for (const UnitRow& u : units)
    out += std::string("<SimpleType name=\"") + u.quantity + "\"><Real quantity=\"" + u.quantity + "\" unit=\"" +
           u.name + "\"/></SimpleType>\n";
  out += "</TypeDefinitions>\n";
  appendLogCategories(out);
}

void appendVariables(Out& to, const std::vector<Block>& blocks, const std::vector<Place>& places, const double* start) {
  std::string& out = to.text();
  std::vector<std::string> tails;  // what every variable of a block has in common, up to the start value
  for (const Block& b : blocks) {
    const UnitRow* unit = unitRow(b.unit);
    std::string tail = "\"";
    tail += causalityAttributes(b.causality);
    tail += std::string("><Real declaredType=\"") + unit->quantity + "\" unit=\"" + unit->name + "\"";
    tails.push_back(tail);
  }
  out += "<ModelVariables>\n";
  for (const Place& p : places) {
    const Block& b = blocks[p.block];
    const bool hasStart = b.causality == Causality::input || b.causality == Causality::parameter;
    for (int k = 0; k < b.components; ++k) {
      const std::size_t offset = static_cast<std::size_t>(p.element) * b.components + k;
      out += "<ScalarVariable name=\"";
      out += variableName(b, p.element, k);
      out += "\" valueReference=\"";
      appendNumber(out, b.reference + offset);
      out += "\" description=\"";
      out += b.description;
      if (!b.prefix.empty()) {
        out += b.labels.empty() ? " (node " + std::to_string(b.ids[p.element]) : " (port " + b.labels[p.element];
        out += ')';
      }
      out += tails[p.block];
      if (hasStart) {
        out += " start=\"";
        appendNumber(out, start[b.place + offset]);
        out += '"';
      }
      out += "/></ScalarVariable>\n";
    }
    to.row();
  }
  out += "</ModelVariables>\n";
}

// ModelStructure: outputs depend on inputs; initial unknowns on inputs and parameters.
class Structure {
 public:
  Structure(const std::vector<Block>& table, const std::vector<Place>& places, const Dependencies& of)
      : blocks(table), listed(places), rows(of) {
    index.resize(rows.all.size());
    isParameter.resize(rows.all.size());
    std::uint32_t next = 1;
    for (const Place& p : listed)
      for (int k = 0; k < blocks[p.block].components; ++k) {
        const std::size_t r = reference(p, k);
        index[r] = next++;
        isParameter[r] = blocks[p.block].causality == Causality::parameter;
      }
  }

  void append(Out& out) const {
    out.text() += "<ModelStructure>\n";
    list(out, "Outputs", false);
    list(out, "InitialUnknowns", true);
    out.text() += "</ModelStructure>\n";
  }

 private:
  std::size_t reference(const Place& p, int component) const {
    const Block& b = blocks[p.block];
    return b.reference + static_cast<std::size_t>(p.element) * b.components + component;
  }

  void list(Out& out, const char* element, bool initial) const {
    const auto wanted = [&](const Block& b) {
      return b.causality == Causality::output || (initial && b.causality == Causality::calculatedParameter);
    };
    // the schema wants at least one entry
    if (std::none_of(blocks.begin(), blocks.end(), [&](const Block& b) { return wanted(b) && b.count() > 0; })) return;
    out.text() += std::string("<") + element + ">\n";
    for (const Place& p : listed) {
      if (!wanted(blocks[p.block])) continue;
      for (int k = 0; k < blocks[p.block].components; ++k) unknown(out.text(), reference(p, k), initial);
      out.row();
    }
    out.text() += std::string("</") + element + ">\n";
  }

  void unknown(std::string& out, std::size_t r, bool initial) const {
    out += "<Unknown index=\"";
    appendNumber(out, index[r]);
    out += '"';
    if (!rows.all[r]) {
      std::vector<Dependency> row;  // here `reference` is an index
      for (std::size_t i = rows.begin[r]; i < rows.begin[r + 1]; ++i) {
        const Dependency& d = rows.entries[i];
        if (initial || !isParameter[d.reference]) row.push_back({index[d.reference], d.kind});
      }
      std::sort(row.begin(), row.end(),
                [](const Dependency& a, const Dependency& b) { return a.reference < b.reference; });
      out += " dependencies=\"";
      for (const Dependency& d : row) {
        appendNumber(out, d.reference);
        out += ' ';
      }
      closeList(out);
      // Without the kinds all are `dependent`. In initialisation the standard knows no `fixed`; and the lists are half
      // of a large file.
      const auto plain = [](const Dependency& d) { return d.kind == Dependence::dependent; };
      if (!initial && !std::all_of(row.begin(), row.end(), plain)) {
        out += " dependenciesKind=\"";
        for (const Dependency& d : row)
          out += d.kind == Dependence::constant ? "constant " : d.kind == Dependence::fixed ? "fixed " : "dependent ";
        closeList(out);
      }
    }
    out += "/>\n";
  }

  static void closeList(std::string& out) {
    if (out.back() == ' ') out.pop_back();
    out += '"';
  }

  const std::vector<Block>& blocks;
  const std::vector<Place>& listed;
  const Dependencies& rows;
  std::vector<std::uint32_t> index;  // of each value reference in the listing, from 1
  std::vector<std::uint8_t> isParameter;
};

}  // namespace

std::string modelIdentifier(const std::string& name) {
  std::string identifier;
  for (char c : name) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_', digit = c >= '0' && c <= '9';
    if (digit && identifier.empty()) identifier += '_';
    identifier += letter || digit ? c : '_';
  }
  return identifier.empty() ? "_" : identifier;
}

struct Xml::Contents : Described {
  Contents(const Model& m, std::string n, std::string t)
      : Contents(m, Simulation(std::shared_ptr<const Model>(std::shared_ptr<void>(), &m)), std::move(n), std::move(t)) {
  }

  bool structuredNames = true;

 private:
  Contents(const Model& m, Simulation&& simulation, std::string n, std::string t)
      : Described{
            &m, std::move(n), std::move(t), {simulation.data(), simulation.data() + simulation.layout().size}, {}, {},
            {}} {
    simulation.initialise(0);
    experiment = defaultExperiment(m, simulation);
    blocks = variables(m, simulation.layout());
    dependencies = tiefmu::dependencies(m, blocks);
    std::size_t count = 0;
    for (const Block& b : blocks) count += b.count();
    // Structured names have numbers in brackets, where ports have names.
    structuredNames = m.settings.names == Names::structured && count <= mostStructuredNames && m.ports.empty();
  }
};

Xml::Xml(const Model& model, std::string name, std::string title)
    : contents_(std::make_unique<Contents>(model, std::move(name), std::move(title))) {}
Xml::~Xml() = default;

double Xml::stepSize() const { return contents_->experiment.step; }

void Xml::write(Standard standard, const std::string& guid, const Sink& sink) const {
  if (standard == Standard::fmi3) return writeFmi3(*contents_, guid, sink);
  const Contents& c = *contents_;
  Out out(sink);
  appendHead(out.text(), c.name, c.title, guid, c.structuredNames);
  appendDefinitions(out.text());
  out.text() += "<DefaultExperiment startTime=\"0\" stopTime=\"";
  appendNumber(out.text(), c.experiment.stop);
  out.text() += "\" stepSize=\"";
  appendNumber(out.text(), c.experiment.step);
  out.text() += "\"/>\n";
  const std::vector<Place> places = listing(c.blocks);
  appendVariables(out, c.blocks, places, c.start.data());
  Structure(c.blocks, places, c.dependencies).append(out);
  out.text() += "</fmiModelDescription>\n";
  out.flush();
}

}  // namespace tiefmu
