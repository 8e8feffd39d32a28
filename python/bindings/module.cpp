// tiefmu._core: the solver, its table of variables and its packaging, for Python and NumPy. What it takes and gives is
// in SI units; arrays that it gives are copies.
#include "../../src/simulation.hpp"
#include "bindings.hpp"

NB_MODULE(_core, m) {
  using namespace tiefmu;
  m.doc() = "The tied interface's solver; see src/scene.hpp, src/model.hpp and src/simulation.hpp.";
  nb::exception<SceneError>(m, "SceneError", PyExc_ValueError).attr("__doc__") =
      "A scene that cannot be read, modelled or started; one line 'FILE: table: id: message'.";
  nb::exception<Diverged>(m, "Diverged", PyExc_RuntimeError).attr("__doc__") =
      "A step ended in a non-finite or runaway number; the state before it has been put back.";
  nb::exception<StepTooLong>(m, "StepTooLong", PyExc_RuntimeError).attr("__doc__") =
      "A step that would take more substeps than any run could make; nothing has changed.";

  bindScene(m);
  bindModel(m);
  bindSimulation(m);
  bindKernels(m);
}
