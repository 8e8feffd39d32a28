// modelDescription.xml of FMI 3.0: an array for what FMI 2.0 writes element by element.
#include <algorithm>

#include "arrays.hpp"
#include "xml.hpp"
#include "xml_text.hpp"

namespace tiefmu {
namespace {

void appendHead(std::string& out, const Described& d, const std::string& token) {
  out += "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"3.0\"";
  attribute(out, "modelName", d.name);
  attribute(out, "instantiationToken", token);
  if (!d.title.empty()) attribute(out, "description", d.title);
  attribute(out, "generationTool", "tiefmu " TIEFMU_VERSION);
  out += ">\n<CoSimulation";
  attribute(out, "modelIdentifier", modelIdentifier(d.name));
  out += R"( canHandleVariableCommunicationStepSize="true" maxOutputDerivativeOrder="1")"
         R"( canBeInstantiatedOnlyOncePerProcess="false" canGetAndSetFMUState="true" canSerializeFMUState="true")"
         R"( providesDirectionalDerivatives="true" providesAdjointDerivatives="true")"
         R"( providesPerElementDependencies="true")"
         R"( providesIntermediateUpdate="true" canReturnEarlyAfterIntermediateUpdate="true"/>)"
         "\n";
}

void appendDefinitions(std::string& out) {
  appendUnits(out);
  out += "<TypeDefinitions>\n";
  for (const UnitRow& u : units)
    out += std::string("<Float64Type name=\"") + u.quantity + "\" quantity=\"" + u.quantity + "\" unit=\"" + u.name +
           "\"/>\n";
  out += "</TypeDefinitions>\n";
  appendLogCategories(out);
}

const char* causalityAttributes(Causality causality) {
  switch (causality) {
    case Causality::parameter: return R"( causality="parameter" variability="fixed")";
    case Causality::calculatedParameter: return R"( causality="calculatedParameter" variability="fixed")";
    case Causality::input: return R"( causality="input" intermediateUpdate="true")";
    case Causality::output: return R"( causality="output" intermediateUpdate="true")";
  }
  return "";
}

void opening(std::string& out, const char* type, const std::string& name, std::uint32_t reference) {
  out += '<';
  out += type;
  attribute(out, "name", name);
  out += " valueReference=\"";
  appendNumber(out, reference);
  out += '"';
}

template <class Number> void list(Out& out, const Number* numbers, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    appendNumber(out.text(), numbers[i]);
    out.text() += ' ';
    out.row();
  }
}

void dimension(std::string& out, std::size_t size) {
  out += "<Dimension start=\"";
  appendNumber(out, size);
  out += "\"/>";
}

void appendArray(Out& to, const Arrays& all, const Array& a, const Described& d) {
  std::string& out = to.text();
  const UnitRow* unit = unitRow(a.unit);
  opening(out, "Float64", a.name, a.reference);
  std::string description(a.description);
  if (!a.scalar) description += "; elements: " + all.elements[a.of].name;
  attribute(out, "description", description);
  out += causalityAttributes(a.causality);
  attribute(out, "declaredType", unit->quantity);
  if (a.causality == Causality::input || a.causality == Causality::parameter) {
    out += " start=\"";
    for (const Span& s : a.spans) list(to, d.start.data() + s.place, s.count);
    if (!out.empty() && out.back() == ' ') out.pop_back();
    out += '"';
  }
  out += '>';
  if (!a.scalar) {
    dimension(out, a.ids.size());
    if (a.components > 1) dimension(out, static_cast<std::size_t>(a.components));
  }
  out += "</Float64>\n";
  to.row();
}

void appendElements(Out& to, const Elements& e) {
  std::string& out = to.text();
  const bool named = !e.labels.empty();
  opening(out, named ? "String" : "Int64", e.name, e.reference);
  attribute(out, "description", named ? "names of the ports" : "ids of the nodes");
  out += R"( causality="local" variability="constant")";
  if (!named) {
    out += " start=\"";
    list(to, e.ids.data(), e.ids.size());
    if (!out.empty() && out.back() == ' ') out.pop_back();
    out += '"';
  }
  out += '>';
  dimension(out, named ? e.labels.size() : e.ids.size());
  for (const std::string& label : e.labels) {
    out += "<Start";
    attribute(out, "value", label);
    out += "/>";
  }
  out += named ? "</String>\n" : "</Int64>\n";
  to.row();
}

// What an array depends on: the union over its elements. Empty `kinds`: on everything.
class Structure {
 public:
  Structure(const Described& described, const Arrays& arrays) : d(described), all(arrays) {}

  void append(Out& out) {
    out.text() += "<ModelStructure>\n";
    for (const Array& a : all.arrays)
      if (a.causality == Causality::output) unknown(out, "Output", a, false);
    for (const Array& a : all.arrays)
      if (a.causality == Causality::output || a.causality == Causality::calculatedParameter)
        unknown(out, "InitialUnknown", a, true);
    out.text() += "</ModelStructure>\n";
  }

 private:
  void unknown(Out& to, const char* element, const Array& a, bool initial) {
    std::string& out = to.text();
    out += std::string("<") + element + " valueReference=\"";
    appendNumber(out, a.reference);
    out += '"';
    kinds.assign(all.arrays.size(), -1);
    bool onAll = false;
    for (const Span& s : a.spans)
      for (std::uint32_t r = s.first; r < s.first + s.count; ++r) {
        onAll |= d.dependencies.all[r] != 0;
        for (std::size_t i = d.dependencies.begin[r]; i < d.dependencies.begin[r + 1]; ++i) {
          const Dependency& entry = d.dependencies.entries[i];
          const std::uint32_t array = all.places[entry.reference].array;
          if (initial || all.arrays[array].causality != Causality::parameter)
            kinds[array] = std::max(kinds[array], static_cast<int>(entry.kind));
        }
      }
    if (!onAll) {
      std::string references, words;
      for (std::size_t k = 0; k < kinds.size(); ++k) {
        if (kinds[k] < 0) continue;
        references += (references.empty() ? "" : " ") + std::to_string(all.arrays[k].reference);
        constexpr const char* names[] = {"constant", "fixed", "dependent"};
        words += (words.empty() ? "" : " ") + std::string(names[kinds[k]]);
      }
      attribute(out, "dependencies", references);
      if (!initial) attribute(out, "dependenciesKind", words);
    }
    out += "/>\n";
    to.row();
  }

  const Described& d;
  const Arrays& all;
  std::vector<int> kinds;  // by array: Dependence, or -1
};

}  // namespace

void writeFmi3(const Described& d, const std::string& token, const Sink& sink) {
  const Arrays all = arraysOf(*d.model, d.blocks);
  Out out(sink);
  appendHead(out.text(), d, token);
  appendDefinitions(out.text());
  out.text() += "<DefaultExperiment startTime=\"0\" stopTime=\"";
  appendNumber(out.text(), d.experiment.stop);
  out.text() += "\" stepSize=\"";
  appendNumber(out.text(), d.experiment.step);
  out.text() += "\"/>\n<ModelVariables>\n";
  opening(out.text(), "Float64", "time", Arrays::time);
  out.text() += " causality=\"independent\" variability=\"continuous\" declaredType=\"Time\"/>\n";
  for (const Array& a : all.arrays) appendArray(out, all, a, d);
  for (const Elements& e : all.elements) appendElements(out, e);
  out.text() += "</ModelVariables>\n";
  Structure(d, all).append(out);
  out.text() += "</fmiModelDescription>\n";
  out.flush();
}

}  // namespace tiefmu
