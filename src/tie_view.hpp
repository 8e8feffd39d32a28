// What the kernels of the tie read and write, as plain data: their builds for other instruction sets share no other
// type.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tiefmu {

// How a slave follows its segment (theory 2).
enum class Coupling : std::uint8_t {
  rotation,     // default formulation, every master of the segment turns: v_s = v_P + w_P x d
  meanMotion,   // optimized formulation: v_s = v_C + w x d
  translation,  // default formulation, masters without rotation: v_s = v_P
};

// What a meanMotion segment needs of its present shape: arms r_i = x_i - C (m), centre C (m), Ibar^-1 (1/m2).
struct SegmentFrame {
  double arm[12];
  double centre[3];
  double inverse[9];
};

// Present geometry, as the kernels read it.
struct TieGeometry {
  const double* offset;       // 3 per slave: d
  const SegmentFrame* frame;  // of the group's first segment; meanMotion only
};

struct SegmentRange { int first, last; };

// Some segments of a TieGroup (model.hpp).
struct TieView {
  Coupling coupling;
  int corners;
  SegmentRange range;
  std::ptrdiff_t firstSlave;
  const int* node;
  const int* begin;
  const double* weight;
};

}  // namespace tiefmu
