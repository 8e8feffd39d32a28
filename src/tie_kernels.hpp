// The kernels of tie.hpp on plain data, built once for each instruction set that pays (tie_baseline.cpp, tie_avx2.cpp).
#pragma once

#include "tie_view.hpp"

namespace tiefmu {

struct TieKernels {
  void (*mapMotion)(const TieView&, TieGeometry, const double* u, const double* turn, double* us, double* turns);
  void (*distributeLoads)(const TieView&, TieGeometry, const double* force, const double* moment, double* f, double* t);
  void (*addBias)(const TieView&, TieGeometry, const double* velocity, const double* spin, double* as, double* zs);
  void (*place)(const TieView&, TieGeometry, const double* position, double* xs);
  bool (*updateFrames)(const TieView&, const double* position, SegmentFrame* frame);
  void (*turnOffsets)(const TieView&, double h, const double* spin, const double* inverseLength2, double* offset);
  bool (*moveSegments)(const TieView&, double h, const double* position, const double* velocity, SegmentFrame* frame,
                       double* rotation);
  void (*rotateOffsets)(const TieView&, const double* rotation, const double* initialOffset, double* offset);
  void (*meanSpin)(const TieView&, const SegmentFrame* frame, const double* velocity, double* spin);
  void (*addScaled)(std::size_t count, double h, const double* rate, double* value);
  void (*accelerate)(std::size_t nodes, const double* load, const double* reaction, const double* mass,
                     const double* added, double* acceleration);
  bool (*within)(std::size_t count, const double* value, double limit);
};

extern const TieKernels baselineKernels;
extern const TieKernels avx2Kernels;

}  // namespace tiefmu
