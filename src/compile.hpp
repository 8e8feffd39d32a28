// From a scene to a model.
#pragma once

#include "model.hpp"

namespace tiefmu {

// Searches, checks and sorts. Throws SceneError with one line naming table and id.
Model compile(const Scene& scene);

}  // namespace tiefmu
