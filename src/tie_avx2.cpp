#define TIEFMU_KERNELS avx2Kernels
#include "tie_kernels.ipp"
