#define TIEFMU_SEGMENT_KERNELS baselineSegmentKernels
#define TIEFMU_SURFACE_KERNELS baselineSurfaceKernels
#include "segment_solve.ipp"
#include "surface_solve.ipp"
