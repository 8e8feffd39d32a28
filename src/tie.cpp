#include "tie.hpp"

#include <cassert>
#include <cmath>

#include "tie_kernels.hpp"
#ifdef TIEFMU_AVX2
#include <cpuid.h>
#endif

namespace tiefmu {
namespace {

#ifdef TIEFMU_AVX2
// Whether processor and system can run AVX2. Not __builtin_cpu_supports, which needs a run-time library that not every
// compiler brings.
bool hasAvx2() {
  unsigned a, b, c, d;
  constexpr unsigned osxsave = 1u << 27, avx = 1u << 28, avx2 = 1u << 5, registers = 6;  // that of SSE and of AVX
  if (!__get_cpuid(1, &a, &b, &c, &d) || (c & osxsave) == 0 || (c & avx) == 0) return false;
  unsigned kept, high;  // which registers the system keeps for each process
  __asm__("xgetbv" : "=a"(kept), "=d"(high) : "c"(0));
  return (kept & registers) == registers && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & avx2) != 0;
}
#endif

const TieKernels* fastest() {
#ifdef TIEFMU_AVX2
  if (hasAvx2()) return &avx2Kernels;
#endif
  return &baselineKernels;
}

const TieKernels* kernels = fastest();

TieView view(const TieGroup& group, SegmentRange range) {
  assert(group.corners == 3 || group.corners == 4);
  assert(0 <= range.first && range.first <= range.last && range.last <= group.segments());
  assert(group.node.size() == static_cast<std::size_t>(group.corners) * group.segments());
  assert(group.weight.size() == static_cast<std::size_t>(group.corners) * group.slaves());
  return {group.coupling,     group.corners,      range, group.firstSlave, group.node.data(),
          group.begin.data(), group.weight.data()};
}

}  // namespace

bool useBaselineKernels(bool baseline) {
  kernels = baseline ? &baselineKernels : fastest();
  return kernels == &baselineKernels;
}

bool usesBaselineKernels() { return kernels == &baselineKernels; }

void mapMotion(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* u, const double* turn,
               double* us, double* turns) {
  assert(u && us);
  kernels->mapMotion(view(group, range), geometry, u, turn, us, turns);
}

void distributeLoads(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* force,
                     const double* moment, double* f, double* t) {
  assert(force && f);
  kernels->distributeLoads(view(group, range), geometry, force, moment, f, t);
}

void addBias(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* velocity,
             const double* spin, double* as, double* zs) {
  kernels->addBias(view(group, range), geometry, velocity, spin, as, zs);
}

void place(const TieGroup& group, SegmentRange range, TieGeometry geometry, const double* position, double* xs) {
  kernels->place(view(group, range), geometry, position, xs);
}

bool updateFrames(const TieGroup& group, SegmentRange range, const double* position, SegmentFrame* frame) {
  assert(group.coupling == Coupling::meanMotion);
  return kernels->updateFrames(view(group, range), position, frame);
}

void turnOffsets(const TieGroup& group, SegmentRange range, double h, const double* spin, const double* inverseLength2,
                 double* offset) {
  assert(group.coupling == Coupling::rotation && std::isfinite(h));
  kernels->turnOffsets(view(group, range), h, spin, inverseLength2, offset);
}

bool moveSegments(const TieGroup& group, SegmentRange range, double h, const double* position, const double* velocity,
                  SegmentFrame* frame, double* rotation) {
  assert(group.coupling == Coupling::meanMotion && std::isfinite(h));
  return kernels->moveSegments(view(group, range), h, position, velocity, frame, rotation);
}

void rotateOffsets(const TieGroup& group, SegmentRange range, const double* rotation, const double* initialOffset,
                   double* offset) {
  assert(group.coupling == Coupling::meanMotion);
  kernels->rotateOffsets(view(group, range), rotation, initialOffset, offset);
}

void meanSpin(const TieGroup& group, SegmentRange range, const SegmentFrame* frame, const double* velocity,
              double* spin) {
  assert(group.coupling == Coupling::meanMotion);
  kernels->meanSpin(view(group, range), frame, velocity, spin);
}

void addScaled(std::size_t count, double h, const double* rate, double* value) {
  assert(count == 0 || (rate && value));
  kernels->addScaled(count, h, rate, value);
}

void accelerate(std::size_t nodes, const double* load, const double* reaction, const double* mass, const double* added,
                double* acceleration) {
  kernels->accelerate(nodes, load, reaction, mass, added, acceleration);
}

bool within(std::size_t count, const double* value, double limit) { return kernels->within(count, value, limit); }

}  // namespace tiefmu
