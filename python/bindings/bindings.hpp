// The parts of the module, each of which adds what it binds.
#pragma once

#include <nanobind/nanobind.h>

namespace tiefmu {

namespace nb = nanobind;
using namespace nb::literals;

void bindScene(nb::module_& module);
void bindModel(nb::module_& module);
void bindSimulation(nb::module_& module);
void bindKernels(nb::module_& module);

}  // namespace tiefmu
