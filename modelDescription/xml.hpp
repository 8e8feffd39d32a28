// modelDescription.xml of co-simulation, by FMI 2.0 and 3.0.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "../src/model.hpp"

namespace tiefmu {

struct LogCategory {
  const char* name;
  const char* description;
};

// What the instance logs under, in the order of Category (fmu/log.hpp).
inline constexpr LogCategory logCategories[] = {
    {"logStatusError", "Errors; they are logged also while logging is off"},
    {"logStatusWarning", "Warnings"},
    {"logTie", "How the slaves are tied, and what to know about it"},
    {"logStability", "Time steps and their limits"},
    {"logAll", "Everything"},
};

// `name` with everything but letters, digits and _ replaced by _, and an _ in front of a digit: a C identifier, and the
// file name of the FMU's binary.
std::string modelIdentifier(const std::string& name);

enum class Standard : std::uint8_t { fmi2, fmi3 };

// The text of a model, which must outlive it. Analysed once, written as often as asked for.
class Xml {
 public:
  // name: of the scene: modelName, and the model identifier as far as C allows. title: free text; may be empty.
  // Throws SceneError where the model cannot start (see Simulation::initialise).
  Xml(const Model& model, std::string name, std::string title);
  ~Xml();
  double stepSize() const;  // of the default experiment, s
  // guid: what the instantiation compares: GUID of FMI 2.0, instantiation token of 3.0. Large models take hundreds of
  // megabytes: `sink` gets the text piece by piece.
  void write(Standard standard, const std::string& guid, const std::function<void(std::string_view)>& sink) const;

 private:
  struct Contents;
  std::unique_ptr<const Contents> contents_;
};

}  // namespace tiefmu
