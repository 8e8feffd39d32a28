// Accelerations of the corners of single segments from the loads on them and on their slaves: the consistent mass
// matrix of one segment, solved directly (theory 4). Plain data, as the kernels are built once for each instruction set
// that pays (segment_baseline.cpp, segment_avx2.cpp); each build computes the same bits.
//
// Four segments are solved side by side. What is constant of them stands in planes: four doubles per number.
#pragma once

#include "tie_view.hpp"

namespace tiefmu {

constexpr int segmentLanes = 4;

// Corners that are not free have 1/m = 1/J = 0; y_i is the load on a free corner, the acceleration of another.
namespace translationPlane {
enum : int { matrix = 0 /*B_ij by rows: a_i = sum B_ij y_j*/, count = 16 };
}  // namespace translationPlane

// One slave on a rotation coupling. s_m = sum phi^2/m, s_J = sum phi^2/J over the free corners, k = 1/(1 + m s_m).
namespace pairPlane {
enum : int {
  weight = 0,          // phi of the 4 corners
  inverseMass = 4,     // 1/m_i
  inverseInertia = 8,  // 1/J_i
  k = 12,
  km = 13,
  sJ = 14,
  inverseSJ = 15,  // 0 for s_J = 0
  whole = 16,      // 1/(1 + s_J (I + k m d^2))
  twist = 17,      // s_J k m / (1 + s_J I)
  count = 18
};
}  // namespace pairPlane

// Any number of slaves on a rotation coupling.
namespace manyPlane {
enum : int {
  free = 0,     // 1 at free corners, 0 at others
  inertia = 4,  // J_i, 1 where not free
  inverse = 8,  // (M + sum m phi phi^T)^-1 of the free corners by rows
  count = 24
};
}  // namespace manyPlane

// All slaves of a meanMotion segment are one rigid body, of mass m, S = sum m d, J = sum m (d^2 1 - d d^T) + I 1.
namespace bodyPlane {
enum : int {
  inverseMass = 0,  // 1/m_i
  s = 4,            // 1 / sum 1/m_i
  mass = 5,
  moment = 6,   // S at the start
  inertia = 9,  // J at the start: xx xy xz yy yz zz
  count = 15
};
}  // namespace bodyPlane

// Segments of one group and kind. Lists are filled up to fours by repeating the last one.
struct SegmentList {
  const int* segment;
  int count;               // a multiple of segmentLanes
  const double* planes;    // of the first segment of the list
  bool mixed;              // are some corners not free?
  int freeBegin, freeEnd;  // nodes that are
};

struct SegmentLoads {
  const double *nodeForce, *nodeMoment;    // 3 per node (rotating node), N, N m
  const double *slaveForce, *slaveMoment;  // 3 per slave (turning slave), N, N m; null: none
  const double *slaveMass, *slaveInertia;
  const double *velocity, *spin;  // of the nodes, for the bias; null: none
  const double* rotation;         // of the group's meanMotion segments, a unit quaternion each; null: not turned
  bool known;                     // are a, z those of corners that are not free? Else they count as zero
};

// a, z: 3 per node (rotating node); read at corners that are not free if `known`, written at those that are. Each
// kernel returns the largest |w|^2 of its bias, (rad/s)^2.
struct SegmentKernels {
  double (*translation)(const TieView&, TieGeometry, const SegmentList&, const SegmentLoads&, double* a, double* z);
  double (*pair)(const TieView&, TieGeometry, const SegmentList&, const SegmentLoads&, double* a, double* z);
  double (*many)(const TieView&, TieGeometry, const SegmentList&, const SegmentLoads&, double* a, double* z);
  double (*body)(const TieView&, TieGeometry, const SegmentList&, const SegmentLoads&, double* a, double* z);
};

extern const SegmentKernels baselineSegmentKernels;
extern const SegmentKernels avx2SegmentKernels;

}  // namespace tiefmu
