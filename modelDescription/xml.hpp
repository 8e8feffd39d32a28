// modelDescription.xml of FMI 2.0 co-simulation.
#pragma once

#include <string>

#include "../src/model.hpp"

namespace tiefmu {

struct LogCategory {
  const char* name;
  const char* description;
};

// What the instance logs under, in the order of fmu/instance.hpp's enumeration.
inline constexpr LogCategory logCategories[] = {
    {"logStatusError", "Errors; they are logged also while logging is off"},
    {"logStatusWarning", "Warnings"},
    {"logTie", "How the slaves are tied, and what to know about it"},
    {"logStability", "Time steps and their limits"},
    {"logAll", "Everything"},
};

struct Description {
  std::string name;   // of the scene: modelName, and the model identifier as far as C allows
  std::string title;  // free text; may be empty
  std::string guid;   // what fmi2Instantiate compares
  std::string generationTool = "tiefmu";
};

// `name` with everything but letters, digits and _ replaced by _, and an _ in front of a digit: a C identifier, and the
// file name of the FMU's binary.
std::string modelIdentifier(const std::string& name);

// Throws SceneError where the model cannot start (see Simulation::initialise).
std::string xml(const Model& model, const Description& description);

}  // namespace tiefmu
