// Where an importer has unpacked the FMU, and the scene that it finds there.
#pragma once

#include <string>

#include "resource.hpp"

namespace tiefmu {

// location: of the folder, a file URI or a plain path, in UTF-8. Throws ResourceError (also when the file cannot be
// read, or belongs to another GUID).
Resource loadResource(const std::string& location, const std::string& guid);

}  // namespace tiefmu
