// The equations of motion of one simulation: geometry, forces, accelerations, and what moves them on.
#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "inertia.hpp"
#include "input_curve.hpp"
#include "layout.hpp"
#include "port.hpp"
#include "spring.hpp"
#include "thread_pool.hpp"
#include "tie.hpp"

namespace tiefmu {

// Works on the array `data` laid out by `layout`; holds only scratch beside it, so that a copy of the array is the
// whole state. No function but the constructor and `prepare` allocates.
class Dynamics {
 public:
  Dynamics(const Model& model, const Layout& layout, double* data);

  const Model& model;
  const Layout& layout;
  double* data;
  double* field(Field f) { return data + layout[f].offset; }
  bool has(Field f) const { return layout[f].count > 0; }

  void setStart();     // every field to its start value
  void prepare();      // from the parameters: added inertia, stiffness, then prepareMass. Throws SceneError
  void prepareMass();  // what stands beside the array: geometry and mass matrix. Throws SceneError
  void updateGeometry();
  void updateMass();  // the mass matrix at the present geometry, as `evaluate` does. Throws SceneError
  // Node ids of a meanMotion segment whose nodes have come to lie on a line, so that its motion is not defined: "1, 2,
  // 3". Empty: none.
  std::string findCollapsedSegment();

  // Loads at the present geometry with `lagged` velocities in the dampers: T^T f_s into the reactions, then the free
  // nodes' accelerations, with `predicted` velocities in the bias.
  void evaluate();
  void evaluateReactions();  // T^T f_s only
  // Sets `lagged` and `predicted`, where this model has them, from velocity and spin plus so many seconds of the
  // accelerations.
  void setForceVelocities(double aheadOfLagged, double aheadOfPredicted);
  void takeDrivenVelocities();  // the driven part of the same, after inputs have changed

  // v += h a over the free nodes.
  void kick(double h);
  // Positions and rotations over h with velocity + ahead * acceleration (free nodes), then the geometry.
  void drift(double h, double ahead);
  // d/dt of the fields velocity .. work at the present state, for a Runge-Kutta stage. `rates` starts at velocity.
  void rates(double* rates);
  // Inputs and ports that move inside the step; no-ops where none does. Before a drift from tau to tau + h the
  // inputs' mean over it, after it their end.
  InputCurve inputs;
  Ports ports;
  void inputsOver(double tau, double h);
  void inputsAt(double tau, double h);
  void movePorts();  // the ports' nodes, after inputs have changed
  void normalise();  // offsets and rotations back to their length after a Runge-Kutta step

  // Outputs at the present state. `evaluate` (or evaluateReactions) must be up to date.
  void updateOutputs();
  // Power into the system from loads, gravity and driven nodes, and that lost in dampers, W.
  struct Power { double external, dissipated; };
  Power power();
  double kineticEnergy();
  double strainEnergy() const { return strain_; }
  // How fast the geometry of the last `evaluate` turns, rad/s: springs and what holds them (which changes the
  // stiffness), and with consistent inertia every tie (whose bias is explicit).
  double turnRate() const { return turnRate_; }
  bool hasBias() const { return bias_ && inertia_; }

  // Restoring loads K u (or damping C u) of the springs for a motion of the free nodes: u 3 per node, turn 3 per
  // rotating node, zero where not free; f, t likewise.
  void springOperator(const double* u, const double* turn, double* f, double* t, bool damping);
  // M^-1 of the free nodes, on node arrays: loads f, t to accelerations a, z, which hold a guess on entry.
  void solveInertia(const double* f, const double* t, double* a, double* z);

  // Of every output, in `derivative` laid out like `data`, along the change of the inputs given there. Outputs must be
  // up to date. Allocates at the first call.
  void directionalDerivative(double* derivative);

  // body(first, last) over blocks of [0, count), shared among threads.
  template <class Body> void eachBlock(std::size_t count, Body body) const;

  std::int64_t evaluations = 0;

 private:
  struct Derivative;
  void differentiateAccelerations(Derivative& change, const double* da, const double* dz, const double* a,
                                  const double* v, const double* w, const double* du, const double* dturn,
                                  const double* dx);
  struct Sprung {
    int group;
    SegmentRange range;
  };
  TieGeometry geometry(std::size_t g) const;
  template <class Body> void eachGroup(Body body) const;  // body(group, all its segments, geometry, index)
  // The same, shared among threads: ranges that cover each group once. `body` may write what belongs to its segments.
  template <class Body> void eachPart(Body body) const;
  template <class Body> void eachSprung(Body body) const;  // the same for runs of segments whose slaves hold springs
  void placeSlaves(double* xs, bool sprungOnly);
  EndMotion motion(const SpringEnd& end, const Spring& spring, const double* v, const double* w) const;
  const double* quaternion(int index) const;
  void gatherLoads();
  void addTo(const SpringEnd& end, const Vec3& force, const Vec3& moment, double* f, double* t, double* fs,
             double* ms) const;
  void distributeAll(const double* force, const double* moment, double* f, double* t);
  void slaveAccelerations(const double* a, const double* z, const double* v, const double* w);
  void inertialLoads();
  void updateTurnRate(const double* v, const double* w);
  void updateInertia();
  void startThreads();
  void advance(std::size_t count, double h, const double* rate, double* value);
  const double* velocityFor(Field f) { return has(f) ? field(f) : field(Field::velocity); }
  const double* spinFor(Field f) { return has(f) ? field(f) + 3 * model.nodes() : field(Field::spin); }

  std::vector<SegmentFrame> frames_;
  std::vector<std::size_t> firstFrame_;          // per group
  std::vector<double> inverseLength2_;           // per turning slave: 1/d0^2
  std::vector<Sprung> sprung_;                   // segments whose slaves hold springs
  std::vector<double> load_, moment_;            // f_s where it is more than the inputs
  std::vector<double> nodeLoad_, nodeMoment_;    // on nodes from springs, inputs and gravity
  std::vector<double> xs_, vs_, ws_;             // slaves, for springs
  std::vector<double> tangent_, tangentMoment_;  // on slaves, from springOperator
  std::vector<double> as_, zs_;                  // slaves' accelerations, or the loads of their inertia
  std::vector<double> right_, rightMoment_;      // right side of the mass matrix
  std::vector<double> step_, stepSpin_;          // velocities of a drift
  std::vector<double> displacement_;             // small geometry: x - X
  const double* slaveLoad_ = nullptr;
  const double* slaveMoment_ = nullptr;
  const double* loadOnNodes_ = nullptr;  // `nodeLoad_`, or the inputs where nothing adds to them
  const double* momentOnNodes_ = nullptr;
  double strain_ = 0, dissipation_ = 0, turnRate_ = 0;
  std::atomic<bool> noneCollapsed_{true};  // no kernel has met a collapsed segment since the last look
  bool gravity_ = false, offsetsTurn_ = false, bias_ = false, knownAccelerations_ = false, drivenMove_ = true;
  std::unique_ptr<ConsistentInertia> inertia_;
  std::unique_ptr<ThreadPool> pool_;        // none where one thread does it all
  std::shared_ptr<Derivative> derivative_;  // scratch of `directionalDerivative`, made at its first call
};

template <class Body> void Dynamics::eachGroup(Body body) const {
  for (std::size_t g = 0; g < model.groups.size(); ++g)
    body(model.groups[g], SegmentRange{0, model.groups[g].segments()}, geometry(g), g);
}

template <class Body> void Dynamics::eachPart(Body body) const {
  if (!pool_) return eachGroup(body);
  for (std::size_t g = 0; g < model.groups.size(); ++g) {
    const TieGroup& group = model.groups[g];
    const std::vector<int>& end = group.partEnd;
    pool_->each(static_cast<int>(end.size()) + 1, [&](int k) {
      const int first = k == 0 ? 0 : end[k - 1], last = k < static_cast<int>(end.size()) ? end[k] : group.segments();
      if (first < last) body(group, SegmentRange{first, last}, geometry(g), g);
    });
  }
}

template <class Body> void Dynamics::eachBlock(std::size_t count, Body body) const {
  constexpr std::size_t smallest = 4096, most = 64;
  const std::size_t blocks = pool_ ? std::clamp<std::size_t>(count / smallest, 1, most) : 1;
  if (blocks == 1) return body(std::size_t{0}, count);
  pool_->each(static_cast<int>(blocks), [&](int k) { body(count * k / blocks, count * (k + 1) / blocks); });
}

template <class Body> void Dynamics::eachSprung(Body body) const {
  for (const Sprung& s : sprung_) body(model.groups[s.group], s.range, geometry(s.group), s.group);
}

}  // namespace tiefmu
