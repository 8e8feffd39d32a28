// The model as bytes: what an FMU carries in resources/scene.bin.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

#include "../src/model.hpp"

namespace tiefmu {

struct Resource {
  Model model;       // without the tie report (slaveReport stays empty)
  std::string guid;  // of the model description that belongs to it
};

// Bytes that are not a resource of this program, or whose model contradicts itself. `what()` is one line.
struct ResourceError : std::runtime_error { using std::runtime_error::runtime_error; };

// The same model and guid give the same bytes, on every platform.
std::string writeResource(const Model& model, const std::string& guid);

// Throws ResourceError for bytes of another origin, another version, cut short or changed.
Resource readResource(std::string_view bytes);

// Throws ResourceError unless every array has the length that its partners imply and every index is in range.
void checkModel(const Model& model);

}  // namespace tiefmu
