#define TIEFMU_SEGMENT_KERNELS avx2SegmentKernels
#define TIEFMU_SURFACE_KERNELS avx2SurfaceKernels
#include "segment_solve.ipp"
#include "surface_solve.ipp"
