// The tie itself: the map of the masters' motion to the slaves (T), theory 2, and the distribution of the slaves' loads
// to the masters (T^T), theory 3. In the terms of coupling libraries the first is a consistent map (a rigid motion is
// passed on exactly) and the second, its transpose, a conservative one (force, moment and power are kept). The mean
// motion of a segment is what finite element codes call RBE3 or a distributing coupling, with equal weights.
//
// Every kernel works on the segments [first, last) of one group. Arrays are indexed as in Model: masters by node (3
// doubles each), slaves by slave (3 doubles each); spin and moment arrays hold the leading rotating nodes and turning
// slaves only. What belongs to a segment is computed once per segment.
#pragma once

#include <vector>

#include "model.hpp"

namespace tiefmu {

// The kernels are built for the baseline of the machine and for AVX2, and the best that it has is used. This chooses
// the baseline instead, for the whole process (tests; results do not depend on it). Returns whether it is the baseline
// now.
bool useBaselineKernels(bool baseline);
bool usesBaselineKernels();

// u_s = T u. `u`, `turn`: 3 per node / rotating node (velocity and spin, or acceleration, or displacement and small
// rotation); writes `us` (3 per slave) and `turns` (3 per turning slave). [theory (2.2), (2.6)]
void mapMotion(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* u, const double* turn,
               double* us, double* turns);

// (f, t) += T^T (F, M): the transpose of `mapMotion`. `force` 3 per slave, `moment` 3 per turning slave (N, N m), added
// to `f` 3 per node and `t` 3 per rotating node. [theory (3.2), (3.3)]
void distributeLoads(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* force,
                     const double* moment, double* f, double* t);

// (a_s, z_s) += b, the part of the slaves' acceleration that is quadratic in velocities. [theory (2.3), (2.7)]
void addBias(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* velocity,
             const double* spin, double* as, double* zs);

// x_s: 3 per slave, from node positions and offsets (m). [theory (2.9)]
void place(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* position, double* xs);

// Arms, centres and Ibar^-1 of meanMotion segments at these node positions. False: one has collapsed to a line or a
// point.
bool updateFrames(const TieGroup& group, SegmentRange range, const double* position, SegmentFrame* frame);

// Offsets of a rotation group turned by exp(h w_P), their length held at 1/sqrt(inverseLength2) to rounding.
// `inverseLength2`: 1/d0^2 per slave, 0 for d0 = 0. [theory (2.10)]
void turnOffsets(const TieGroup& group, SegmentRange range, double h, const double* spin, const double* inverseLength2,
                 double* offset);

// meanMotion segments over a step in which their nodes move from `position` by h `velocity`: the frames at its end, and
// (unless null) the rotation, a unit quaternion (w, x, y, z) per segment. The rotation is the Cayley map of h w / 2, w
// at mid step: of all second-order choices the one that turns with a segment that rotates rigidly exactly, since its
// nodes then move by 2 tan(angle / 2) n x r_mid, theory (2.11). False as above.
bool moveSegments(const TieGroup& group, SegmentRange range, double h, const double* position, const double* velocity,
                  SegmentFrame* frame, double* rotation);

// d = R d0 for the slaves of meanMotion segments.
void rotateOffsets(const TieGroup& group, SegmentRange range, const double* rotation, const double* initialOffset,
                   double* offset);

// Angular velocity of each meanMotion segment: w = Ibar^-1 sum r x v. `spin`: 3 per segment. [theory (2.5)]
void meanSpin(const TieGroup& group, SegmentRange range, const SegmentFrame* frame, const double* velocity,
              double* spin);

// Loops over nodes that every step makes.
// value += h rate
void addScaled(std::size_t count, double h, const double* rate, double* value);
// (load + reaction) / (mass + added): 3 per node over 1 per node.
void accelerate(std::size_t nodes, const double* load, const double* reaction, const double* mass, const double* added,
                double* acceleration);
// Is every |value| below the limit? NaN is not.
bool within(std::size_t count, const double* value, double limit);

// A motion of nodes that derivatives are taken along, or gradients by it: m, m/s, rad/s; 3 per node, w per rotating
// node. x: null where no position changes.
struct MotionChange { double *x, *v, *w; };

// Derivatives along a change dx of the nodes' positions (3 per node, m), which only meanMotion couplings feel, and the
// bias also along v and w. Each adds to its result: forward to what stands last, transposed to the change.
//   mapMotionDerivative: (dT) u    distributeLoadsDerivative: (dT)^T (F, M)    biasDerivative: db
void mapMotionDerivative(Way way, const TieGroup& group, TieGeometry geometry, double* dx, const double* u, double* us,
                         double* turns);
void distributeLoadsDerivative(Way way, const TieGroup& group, TieGeometry geometry, double* dx, const double* force,
                               const double* moment, double* f);
void biasDerivative(Way way, const TieGroup& group, TieGeometry geometry, const double* velocity, const double* spin,
                    const MotionChange& change, double* as, double* zs);

}  // namespace tiefmu
