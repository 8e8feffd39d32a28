#include "divergence.hpp"

#include <atomic>
#include <cmath>
#include <cstdio>

#include "step_errors.hpp"

namespace tiefmu {
namespace {

constexpr double runaway = 3e8;   // m/s, rad/s: no explicit solution that is still one gets there
constexpr double farAway = 1e30;  // m: beyond it squares of lengths overflow before long

std::string start(double time) {
  char text[80];
  std::snprintf(text, sizeof text, "diverged at t = %.9g s: ", time);
  return text;
}

}  // namespace

bool DivergenceChecks::allWithin(std::size_t count, const double* value, double limit) {
  std::atomic<bool> result{true};
  d_.ties.eachBlock(count, [&](std::size_t first, std::size_t last) {
    if (!within(last - first, value + first, limit)) result = false;
  });
  return result;
}

void DivergenceChecks::checkVelocities(double time, double limit) {
  const Model& model = d_.model;
  const int first = model.freeBegin(), last = model.freeEnd(), turning = model.rotating();
  if (last > first && !allWithin(3 * (last - first), d_.field(Field::velocity) + 3 * first, runaway))
    findVelocity(Field::velocity, last, time, limit);
  if (turning > first && !allWithin(3 * (turning - first), d_.field(Field::spin) + 3 * first, runaway))
    findVelocity(Field::spin, turning, time, limit);
}

void DivergenceChecks::findVelocity(Field f, int last, double time, double limit) const {
  const Model& model = d_.model;
  const double* v = d_.field(f);
  for (int i = model.freeBegin(); i < last; ++i)
    for (int k = 0; k < 3; ++k) {
      if (std::abs(v[3 * i + k]) < runaway) continue;  // false for NaN
      char text[200];
      std::snprintf(text, sizeof text, "%s of node %lld is %.3g %s; limit of the time step %.3g s",
                    f == Field::velocity ? "velocity" : "angular velocity", static_cast<long long>(model.nodeId[i]),
                    v[3 * i + k], f == Field::velocity ? "m/s" : "rad/s", limit);
      throw Diverged(start(time) + text, d_.layout[f].offset + static_cast<std::size_t>(3 * i + k));
    }
}

void DivergenceChecks::checkPositions(double time, double h) {
  const double *x = d_.field(Field::position), *v = d_.field(Field::velocity);
  const std::size_t count = d_.layout[Field::position].count;
  if (allWithin(count, x, farAway / 2) && (h == 0 || allWithin(count, v, farAway / (2 * h)))) return;
  findPosition(x, v, count, time, h);
}

void DivergenceChecks::findPosition(const double* x, const double* v, std::size_t count, double time, double h) const {
  for (std::size_t k = 0; k < count; ++k) {
    if (std::abs(x[k] + h * v[k]) < farAway) continue;  // false for NaN
    char text[120];
    std::snprintf(text, sizeof text, "position of node %lld is %.3g m", static_cast<long long>(d_.model.nodeId[k / 3]),
                  x[k] + h * v[k]);
    throw Diverged(start(time) + text, d_.layout[Field::position].offset + k);
  }
}

void DivergenceChecks::checkEachPort(double time, double h) {
  for (const auto& [place, rate] :
       {std::pair{Field::portPlace, Field::portVelocity}, std::pair{Field::portRotation, Field::portSpin}})
    for (std::size_t k = 0; k < d_.layout[rate].count; ++k) {
      const double from = place == Field::portPlace ? d_.field(place)[k] : 0;
      if (std::abs(from + h * d_.field(rate)[k]) < farAway) continue;  // false for NaN
      throw Diverged(start(time) + "port '" + d_.model.ports[k / 3].name + "' leaves the world",
                     d_.layout[rate].offset + k);
    }
  const std::string flat = d_.ports.findCollapsed();
  if (!flat.empty()) throw Diverged(start(time) + "the slaves of port '" + flat + "' have come to lie on a line");
}

void DivergenceChecks::checkEachSegment(double time) {
  const std::string nodes = d_.ties.findCollapsedSegment();
  if (!nodes.empty())
    throw Diverged(start(time) + "the segment of nodes " + nodes + " has collapsed to a line or a point");
}

}  // namespace tiefmu
