// What one step of the iteration for connected segments computes (theory 4): products with T^T M_s T and the diagonal
// blocks of the mass matrix by segments, the rest by nodes. Plain data, built once for each instruction set that pays;
// each build computes the same bits.
//
// Vectors of the iteration hold `width` numbers a node: 3, or 6 where some node rotates (translation, rotation). Nodes
// have numbers of their own, filled up to fours; one past them stands for corners that are not free: what comes in for
// it is zero, what goes out to it is not looked at. Four segments (or nodes) stand side by side: what is kept of them
// stands in planes, four doubles a number.
#pragma once

#include "segment_solve.hpp"

namespace tiefmu {

// A slave of a segment of default ties.
namespace shapePlane {
enum : int { weight = 0 /*phi of the corners*/, mass = 4, inertia = 5, offset = 6, count = 9 };
}  // namespace shapePlane

// A meanMotion segment and the body of its slaves, as they stand now.
namespace meanPlane {
enum : int {
  arm = 0,           // r of the corners, three each
  inverseIbar = 12,  // Ibar^-1: xx xy xz yy yz zz, as all below
  mass = 18,
  moment = 19,   // S
  inertia = 22,  // J
  atStart = 28,  // S and J at the start
  count = 37
};
}  // namespace meanPlane

// A diagonal block [A -[c]; [c] W]: 15 numbers a node, of which nodes of width 3 use A alone; its inverse likewise, as
// A^-1, c and the inverse of W + [c] A^-1 [c].
namespace nodeBlock {
enum : int { translation = 0, lever = 6, rotation = 9, count = 15 };
}  // namespace nodeBlock

// Segments of one group that one thread takes.
struct SurfacePart {
  int corners, width;
  int fours;              // of segments
  const int* corner;      // numbers of the nodes, of each four `corners` times four
  const int* node;        // the same as nodes of the model
  const int* firstSlave;  // of each four its first four of slaves, and one past the last
  const int* slave;       // of each four of slaves
  const double* there;    // 1, or 0 where a segment has no more slaves
  double* planes;         // of the first four of segments (meanMotion) or slaves
};

// What the planes are made of.
struct SurfaceShape {
  const int* index;      // of each lane its segment (meanMotion) or slave; any where a four has none
  const double* offset;  // 3 per slave; null: slaves that do not turn
  const SegmentFrame* frame;
  const double* rotation;  // null: not turned
};

struct SurfaceVectors {  // each `width` numbers a node
  double *x, *residual, *scaled /*z = B r*/, *product /*w = M z*/, *direction, *image /*M direction*/;
  const double* own;  // the nodes' own masses and inertias, one a number
  double* block;      // nodeBlock of each node
  double* inverse;    // in planes
};

struct Sums { double first, second, third = 0; };

struct SurfaceKernels {
  // Adds T^T (loads - M_s (T q'' + b)), with a, z for q''. Returns the largest |w|^2 of its bias, (rad/s)^2.
  double (*leaveShapes)(const SurfacePart&, bool turns, const double* offset, const SegmentLoads&, const double* a,
                        const double* z, double* residual);
  double (*leaveMean)(const SurfacePart&, const double* offset, const SegmentLoads&, const double* a, double* residual);
  // The planes at this geometry. Adds the segments' part to the diagonal blocks.
  void (*prepareShapes)(const SurfacePart&, const SurfaceShape&, double* block);
  void (*prepareMean)(const SurfacePart&, const SurfaceShape&, double* block);
  // out += T^T M_s T in. Returns in . T^T M_s T in.
  double (*multiplyShapes)(const SurfacePart&, const double* in, double* out);
  double (*multiplyMean)(const SurfacePart&, const double* in, double* out);
  // Fours of nodes [first, last).
  // The inverses of the diagonal blocks. False: a pivot is lost in rounding.
  bool (*invert)(int width, int first, int last, const SurfaceVectors&);
  // r . B r; about b . B b of the right side b = r + M x, with the diagonal blocks in place of M; and the same of what
  // of the nodes' inertia is slaves'.
  Sums (*measure)(int width, int first, int last, const SurfaceVectors&);
  // z = B r, w = (own) z. Returns r . z and z . w.
  Sums (*start)(int width, int first, int last, const SurfaceVectors&);
  // direction = z + beta direction and so on, then as `start`.
  Sums (*advance)(int width, int first, int last, double alpha, double beta, const SurfaceVectors&);
};

extern const SurfaceKernels baselineSurfaceKernels;
extern const SurfaceKernels avx2SurfaceKernels;

}  // namespace tiefmu
