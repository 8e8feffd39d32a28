// A scene made ready to compute: slaves bound to their segments and sorted by them, nodes sorted into ranges, springs
// resolved to the ends they hold. Constant after `compile`, shared by every simulation of it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "scene.hpp"
#include "tie_view.hpp"

namespace tiefmu {

template <> inline constexpr auto words<Coupling> = std::array{"rotation", "mean-motion", "translation"};

// What a coupling needs and gives.
struct Kinematics {
  bool slavesTurn;    // slaves have a rotation and take moments
  bool mastersTurn;   // the masters' rotations move the slaves, so masters get moments
  bool segmentsTurn;  // each segment has a SegmentFrame, and its own rotation
};
constexpr Kinematics kinematicsOf(Coupling coupling) {
  switch (coupling) {
    case Coupling::rotation: return {.slavesTurn = true, .mastersTurn = true, .segmentsTurn = false};
    case Coupling::meanMotion: return {.slavesTurn = true, .mastersTurn = false, .segmentsTurn = true};
    case Coupling::translation: return {.slavesTurn = false, .mastersTurn = false, .segmentsTurn = false};
  }
  return {};
}

// Independent nodes (masters and points) are sorted into these groups, by ascending id inside each (along a curve where
// ids are scattered: localOrder). Rotating nodes come first and free ones stand together, so that every array below is
// a contiguous slice of its field: rotating = [0, begin[freeMaster]), free = [begin[rotatingFreeMaster],
// begin[fixedMaster]).
enum NodeGroup : int {
  rotatingDrivenMaster,
  rotatingDrivenPoint,
  rotatingFixedMaster,
  rotatingFixedPoint,
  rotatingFreeMaster,
  rotatingFreePoint,
  freeMaster,
  freePoint,
  fixedMaster,
  fixedPoint,
  drivenMaster,
  drivenPoint,
  nodeGroups
};

// Slaves of one coupling on segments of one shape, contiguous in every slave array and grouped by segment.
struct TieGroup {
  Coupling coupling;
  int corners;                 // 4 or 3
  int firstSlave;              // index of the group's first slave in the slave arrays
  std::vector<int> node;       // corners per segment: independent node indices
  std::vector<int> begin;      // segments + 1: slaves of segment e are firstSlave + [begin[e], begin[e+1])
  std::vector<double> weight;  // corners per slave: Phi at the projection, sum 1
  std::vector<int> partEnd;    // Partition: parts for threads,
  std::vector<int> phaseEnd;   // and the phases in which they come
  int segments() const { return static_cast<int>(begin.size()) - 1; }
  int slaves() const { return begin.back(); }
};

// One end of a spring. Exactly one of node, slave is >= 0, or none: ground.
struct SpringEnd {
  int node = -1;
  int slave = -1;
  // Where the spring needs the end's rotation: which unit quaternion, counted through the meanMotion segments (all
  // groups), then Model::oriented.
  int orientation = -1;
};

struct Spring {
  SpringEnd a, b;
  SpringKind kind;
  Vec3 stiffness, damping;                      // N/m, N s/m; axial: the first entry of each; beam: along its axes
  Vec3 rotationalStiffness, rotationalDamping;  // N m/rad, N m s/rad
  Vec3 arm;                                     // position of a minus position of b at the start, m (zero for ground)
  Vec3 anchor;                                  // ground: where it is, m
  double length;                                // at the start, of an axial spring the rest length, m
  Vec3 along = Vec3::Zero(), across = Vec3::Zero();  // of a beam: its first and second axis at the start
};

// Nodes that the interface shows as one rigid body about a reference point.
struct Port {
  std::string name;
  int number = 0;                // from 1 in the scene's order
  std::uint8_t ofSlaves = 0;     // 1: of slaves, which it loads; 0: of driven nodes, which it moves
  std::vector<int> member;       // indices of slaves, or of independent nodes
  std::vector<double> arm;       // 3 per member, at the start: from the slaves' mean, or from the reference point, m
  Vec3 place = Vec3::Zero();     // reference point at the start, m
  Vec3 lever = Vec3::Zero();     // of slaves: from their mean to the reference point at the start, m
  Vec3 velocity = Vec3::Zero();  // of driven nodes, at the start, m/s
  Vec3 spin = Vec3::Zero();      // rad/s
  // Slaves on a line: what the slaves' own rotations weigh beside their positions, m2. Else 0: they do not.
  double turnWeight = 0;
  std::vector<int> orientation;  // then, where there is a lever: per member its SpringEnd::orientation, or -1
};

struct Finding {  // one line of the tie report
  enum Kind { warning, note } kind;
  std::string text;
};

struct Dropped {  // a slave that its tie's search did not find
  std::int64_t id;
  int tie;
  std::string reason;
};

struct SlaveReport {
  std::int64_t segment = 0;  // id
  double xi = 0, eta = 0;    // of the projection
  double distance = 0;       // slave to its projection, m
  int tie = 0;
  bool clamped = false;  // its inertia uses the projection clamped to the segment
};

struct Model {
  Settings settings;

  // independent nodes, sorted by group
  std::array<int, nodeGroups + 1> begin{};
  std::vector<std::int64_t> nodeId;
  std::vector<int> nodeNumber;                                 // i of master[i], p of point[p]: from 1 by ascending id
  std::vector<double> nodePosition, nodeVelocity;              // 3 per node at the start, m and m/s
  std::vector<double> nodeSpin;                                // 3 per rotating node at the start, rad/s
  std::vector<double> nodeMass, nodeInertia;                   // of its own, kg and kg m2
  std::vector<double> nodeStiffness, nodeRotationalStiffness;  // declared, N/m and N m/rad

  // slaves: turning ones (rotation, meanMotion) first
  std::vector<std::int64_t> slaveId;
  std::vector<int> slaveNumber;                                  // j of slave[j]: from 1 by ascending id
  std::vector<double> slaveOffset;                               // 3 per slave: d at the start, m
  std::vector<double> slaveMass, slaveInertia;                   // kg, kg m2
  std::vector<double> slaveStiffness, slaveRotationalStiffness;  // N/m, N m/rad; empty where no slave declares any
  int turningSlaves = 0;                                         // how many can turn
  std::vector<TieGroup> groups;  // in slave order: rotation, meanMotion, translation; quads before triangles

  std::vector<Spring> springs;
  std::vector<SpringEnd> oriented;  // ends whose rotation is tracked as a unit quaternion

  std::vector<Port> ports;  // those of driven nodes first

  // what the report says
  std::vector<std::string> tieName;
  std::vector<double> searchDistance;    // per tie: as given, or the default, m
  std::vector<SlaveReport> slaveReport;  // in slave order
  std::vector<Finding> findings;
  std::vector<Dropped> dropped;
  std::vector<std::int64_t> leftOut;  // nodes that no tie and no spring uses

  int nodes() const { return begin[nodeGroups]; }
  int rotating() const { return begin[freeMaster]; }
  int freeBegin() const { return begin[rotatingFreeMaster]; }
  int freeEnd() const { return begin[fixedMaster]; }
  int free() const { return freeEnd() - freeBegin(); }
  int slaves() const { return static_cast<int>(slaveId.size()); }
  int turning() const { return turningSlaves; }
  bool anyFree() const { return free() > 0; }
  bool anyDriven() const;
  std::size_t drivenPorts() const;
  bool isMaster(int group) const { return group % 2 == 0; }
  bool exposes(const char* name) const;  // is this name of `expose` asked for?

  bool needsPositions() const;  // node positions are states (or inputs)
  bool finite() const { return settings.geometry == Geometry::finite; }
  bool shareable() const;  // large enough that threads find parts to share
  bool accelerationInputs() const { return settings.reaction != Reaction::loads; }
};

}  // namespace tiefmu
