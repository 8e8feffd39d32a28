// What the writers of modelDescription.xml share: units, numbers and attributes as text, and what they describe.
#pragma once

#include <charconv>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "dependencies.hpp"
#include "variables.hpp"
#include "xml.hpp"

namespace tiefmu {

struct UnitRow {
  const char* name;
  const char* base;      // attributes of BaseUnit
  const char* quantity;  // name of the type that has this unit
};

// Every unit of the table of variables. A unit belongs to one quantity.
inline constexpr UnitRow units[] = {
    {"1", "", "Ratio"},
    {"m", R"( m="1")", "Length"},
    {"m/s", R"( m="1" s="-1")", "Velocity"},
    {"m/s2", R"( m="1" s="-2")", "Acceleration"},
    {"rad/s", R"( s="-1" rad="1")", "AngularVelocity"},
    {"rad/s2", R"( s="-2" rad="1")", "AngularAcceleration"},
    {"s", R"( s="1")", "Time"},
    {"kg", R"( kg="1")", "Mass"},
    {"kg.m2", R"( kg="1" m="2")", "MomentOfInertia"},
    {"N", R"( kg="1" m="1" s="-2")", "Force"},
    {"N.m", R"( kg="1" m="2" s="-2")", "Moment"},
    {"N/m", R"( kg="1" s="-2")", "Stiffness"},
    {"N.m/rad", R"( kg="1" m="2" s="-2" rad="-1")", "RotationalStiffness"},
    {"J", R"( kg="1" m="2" s="-2")", "Energy"},
    {"W", R"( kg="1" m="2" s="-3")", "Power"},
};

inline constexpr bool isUnit(std::string_view name) {
  for (const UnitRow& u : units)
    if (name == u.name) return true;
  return false;
}

inline const UnitRow* unitRow(std::string_view name) {
  for (const UnitRow& u : units)
    if (name == u.name) return &u;
  return nullptr;
}

// Integers, and doubles as the shortest text that reads back to the same double.
template <class Number> void appendNumber(std::string& out, Number number) {
  char text[32];
  out.append(text, std::to_chars(text, text + sizeof text, number).ptr);
}

// Text as an attribute value. XML 1.0 knows no control characters but tab and line ends, and those become blanks in
// an attribute anyway.
inline void appendEscaped(std::string& out, std::string_view text) {
  for (char c : text) switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '"': out += "&quot;"; break;
      default: out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? ' ' : c;
    }
}

inline void attribute(std::string& out, std::string_view name, std::string_view value) {
  out += ' ';
  out += name;
  out += "=\"";
  appendEscaped(out, value);
  out += '"';
}

inline void appendUnits(std::string& out) {
  out += "<UnitDefinitions>\n";
  for (const UnitRow& u : units) out += std::string("<Unit name=\"") + u.name + "\"><BaseUnit" + u.base + "/></Unit>\n";
  out += "</UnitDefinitions>\n";
}

inline void appendLogCategories(std::string& out) {
  out += "<LogCategories>\n";
  for (const LogCategory& c : logCategories) {
    out += "<Category";
    attribute(out, "name", c.name);
    attribute(out, "description", c.description);
    out += "/>\n";
  }
  out += "</LogCategories>\n";
}

// Text on its way to the caller, handed over whenever there is a piece of it.
class Out {
 public:
  explicit Out(const std::function<void(std::string_view)>& sink) : sink_(sink) { text_.reserve(piece + piece / 4); }
  std::string& text() { return text_; }
  void row() {
    if (text_.size() > piece) flush();
  }
  void flush() {
    sink_(text_);
    text_.clear();
  }

 private:
  static constexpr std::size_t piece = 1 << 20;
  const std::function<void(std::string_view)>& sink_;
  std::string text_;
};

struct Experiment { double step, stop; };  // s

struct Described {
  const Model* model;
  std::string name, title;
  std::vector<double> start;  // Simulation::data() at the start
  Experiment experiment;
  std::vector<Block> blocks;
  Dependencies dependencies;
};

using Sink = std::function<void(std::string_view)>;
// FMI 3.0 for co-simulation; `token`: what fmi3InstantiateCoSimulation compares.
void writeFmi3(const Described& described, const std::string& token, const Sink& sink);

}  // namespace tiefmu
