#define TIEFMU_KERNELS baselineKernels
#include "tie_kernels.ipp"
