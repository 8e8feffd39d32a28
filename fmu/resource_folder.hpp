// Where an importer has unpacked the FMU, and the scene that it finds there.
#pragma once

#include <string>

#include "resource.hpp"

namespace tiefmu {

// Path of a file in the resource folder, from its location: a file URI or a plain path.
std::string resourcePath(const std::string& location, const char* file);

// Throws ResourceError (also when the file cannot be read, or belongs to another GUID).
Resource loadResource(const std::string& location, const std::string& guid);

}  // namespace tiefmu
