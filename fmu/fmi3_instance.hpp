// What stands behind an fmi3Instance.
#pragma once

#include <memory>

#include "array_access.hpp"
#include "call.hpp"
#include "fmi3_calls.hpp"

extern "C" {
#include "fmi3Functions.h"
}

namespace tiefmu {

struct Fmi3Instance {
  Fmi3Instance(std::unique_ptr<Log> log, Resource resource, fmi3InstanceEnvironment instanceEnvironment,
               fmi3IntermediateUpdateCallback callback, bool earlyReturnAllowed)
      : instance(std::move(log), std::move(resource)),
        environment(instanceEnvironment),
        intermediateUpdate(callback),
        earlyReturn(earlyReturnAllowed) {}

  Instance instance;
  ArrayAccess arrays{instance};
  fmi3InstanceEnvironment environment;
  fmi3IntermediateUpdateCallback intermediateUpdate;  // or a null pointer
  bool earlyReturn;
};

namespace fmi3 {

template <class Body> fmi3Status guard(fmi3Instance c, const Call& call, Body body) noexcept {
  auto* own = static_cast<Fmi3Instance*>(c);
  const bool good = succeeds(own ? &own->instance : nullptr, call, stateName, [&](Instance&) { body(*own); });
  return good ? fmi3OK : fmi3Error;
}

}  // namespace fmi3

}  // namespace tiefmu
