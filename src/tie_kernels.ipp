// The kernels of tie.hpp, compiled in each build under its own flags. Nothing here may use a function that another
// build shares, or the linker could keep the one that this machine cannot run.
#include "node_kernels.ipp"
#include "tie_geometry.ipp"
#include "tie_kernels.hpp"
#include "tie_map.ipp"

namespace tiefmu {

const TieKernels TIEFMU_KERNELS = {mapMotion,    distributeLoads, addBias,  place,     updateFrames, turnOffsets,
                                   moveSegments, rotateOffsets,   meanSpin, addScaled, accelerate,   within};

}  // namespace tiefmu
