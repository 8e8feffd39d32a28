// What one step of the iteration for connected segments computes (theory 4): products with T^T M_s T and the diagonal
// blocks of the mass matrix by segments, the rest by nodes. Plain data, built once for each instruction set that pays;
// each build computes the same bits.
//
// Vectors of the iteration hold `width` numbers a node: 3, or 6 where some node rotates (translation, rotation). Nodes
// have numbers of their own, filled up to fours; one past them stands for corners that are not free: what comes in for
// it is zero, what goes out to it is not looked at. Four segments (or nodes) stand side by side: what is kept of them
// stands in planes, four doubles a number. Segments whose slaves do not turn are taken one by one.
#pragma once

#include "segment_solve.hpp"

namespace tiefmu {

// Numbers of a segment whose slaves do not turn: sum m phi phi^T, the upper triangle by rows.
constexpr int shareCount = 10;

// A slave of a segment of default ties that turn.
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
  int count;              // fours of segments; segments, where slaves do not turn
  const int* corner;      // numbers of the nodes, of each four `corners` times four (of each segment `corners`)
  const int* node;        // the same as nodes of the model
  const int* firstSlave;  // of each four its first four of slaves, and one past the last; not where they do not turn
  const int* slave;       // of each four of slaves; where they do not turn, of each segment its first and past its last
  const double* there;    // 1, or 0 where a segment has no more slaves
  double* planes;         // of the first four of segments (meanMotion) or slaves; of the first segment
  const double* weight;   // phi of slave 0, where slaves do not turn
};

// What the planes are made of.
struct SurfaceShape {
  const int* index;      // of each lane its segment (meanMotion) or slave; any where a four has none
  const double* offset;  // 3 per slave
  const SegmentFrame* frame;
  const double* rotation;  // null: not turned
};

struct SurfaceVectors {  // each `width` numbers a node
  double *x, *residual, *scaled /*z = B r*/, *product /*w = M z*/, *direction, *image /*M direction*/;
  const double* own;  // the nodes' own masses and inertias, one a number
  double* block;      // nodeBlock of each node
  double* inverse;    // in planes
};

// Which nodes of the model the numbers are; the first `turning` of them turn.
struct SurfaceNodes {
  const int* node;
  int turning;
};

struct Sums {
  double residual = 0, energy = 0;  // r . z, z . w
  // Of the right side b = r + M x, about, with the diagonal blocks in place of M: b . B b, and the same of what of the
  // nodes' inertia is slaves'.
  double size = 0, shared = 0;
  double along = 0;  // r . direction
};

struct SurfaceKernels {
  // Adds T^T (loads - M_s (T q'' + b)), with a, z for q''. Returns the largest |w|^2 of its bias, (rad/s)^2.
  double (*leaveShares)(const SurfacePart&, const SegmentLoads&, const double* a, double* residual);
  double (*leaveShapes)(const SurfacePart&, const double* offset, const SegmentLoads&, const double* a, const double* z,
                        double* residual);
  double (*leaveMean)(const SurfacePart&, const double* offset, const SegmentLoads&, const double* a, double* residual);
  // The planes at this geometry, where they change with it. Adds the segments' part to the diagonal blocks.
  void (*prepareShares)(const SurfacePart&, double* block);
  void (*prepareShapes)(const SurfacePart&, const SurfaceShape&, double* block);
  void (*prepareMean)(const SurfacePart&, const SurfaceShape&, double* block);
  // out += T^T M_s T in. Returns in . T^T M_s T in.
  double (*multiplyShares)(const SurfacePart&, const double* in, double* out);
  double (*multiplyShapes)(const SurfacePart&, const double* in, double* out);
  double (*multiplyMean)(const SurfacePart&, const double* in, double* out);
  // Fours of nodes [first, last).
  // The inverses of the diagonal blocks. False: a pivot is lost in rounding.
  bool (*invert)(int width, int first, int last, const SurfaceVectors&);
  // Nodes [first, last). x = a, z and r = loads - (own) x.
  void (*begin)(int width, int first, int last, const SurfaceNodes&, const SegmentLoads&, const double* a,
                const double* z, const SurfaceVectors&);
  // A vector of the iteration to, and from, arrays of 3 per node (rotating node).
  void (*give)(int width, int first, int last, const SurfaceNodes&, const double* x, double* a, double* z);
  void (*take)(int width, int first, int last, const SurfaceNodes&, const double* a, const double* z, double* x);
  // Fours of nodes again. z = B r, w = (own) z; all sums, the last one if asked for.
  Sums (*start)(int width, int first, int last, bool along, const SurfaceVectors&);
  // z = direction, w = (own) z. Returns z . w.
  double (*turn)(int width, int first, int last, const SurfaceVectors&);
  // direction = z + beta direction (beta = 0: whatever it was) and so on, then z = B r, w = (own) z, and their sums.
  Sums (*advance)(int width, int first, int last, double alpha, double beta, const SurfaceVectors&);
};

extern const SurfaceKernels baselineSurfaceKernels;
extern const SurfaceKernels avx2SurfaceKernels;

}  // namespace tiefmu
