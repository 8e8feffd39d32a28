// Springs to the ends they hold, and which ends need their rotation.
#include "compilation.hpp"

namespace tiefmu {

bool Compilation::canTurn(const SpringEnd& end) const {
  return end.slave >= 0 ? end.slave < model.turningSlaves : end.node >= 0 && end.node < model.rotating();
}

// Quaternions are counted through: first those of the meanMotion segments, then those of `oriented`.
void Compilation::orient(SpringEnd& end) {
  if (end.slave >= 0 && segmentRotation[end.slave] >= 0) {
    end.orientation = segmentRotation[end.slave];
    return;
  }
  int& index = end.slave >= 0 ? orientationOfSlave[end.slave] : orientationOfNode[end.node];
  if (index < 0) {
    index = meanMotionSegments + static_cast<int>(model.oriented.size());
    end.orientation = index;
    model.oriented.push_back(end);
  }
  end.orientation = index;
}

// The first axis runs from b to a, as the arm does; the second one lies on the side of the orientation. False where
// that is parallel to the first.
static bool axesOfBeam(const SceneSpring& spec, Spring& spring) {
  constexpr double parallel = 1e-6;  // sine of the least angle
  spring.along = spring.arm / spring.length;
  Vec3 side = spec.orientation;
  const bool given = !side.isZero(0);
  if (!given) side = Vec3::UnitY();
  side.normalize();
  if (!given && side.cross(spring.along).norm() < parallel) side = Vec3::UnitZ();
  side -= side.dot(spring.along) * spring.along;
  if (!(side.norm() >= parallel)) return false;
  spring.across = side.normalized();
  return true;
}

void Compilation::placeSprings() {
  orientationOfSlave.assign(bonds.size(), -1);
  orientationOfNode.assign(model.nodeId.size(), -1);
  for (const SceneSpring& spec : scene.springs) {
    const std::string where = spec.name + ": ";
    Spring spring{};
    for (const auto& [node, end] : {std::pair{spec.a, &spring.a}, std::pair{spec.b, &spring.b}}) {
      if (node < 0) continue;
      if (bound[node])
        end->slave = slaveIndex[node];
      else
        end->node = nodeIndex[node];
    }
    const bool ground = spec.b < 0;
    if (!ground && spec.a == spec.b) throw SceneError(where + "node " + id(spec.a) + " is joined to itself");
    const Vec3 a = scene.nodes.position[spec.a], b = ground ? a : scene.nodes.position[spec.b];
    spring.kind = spec.kind;
    spring.stiffness = spec.stiffness;
    spring.damping = spec.damping;
    spring.rotationalStiffness = spec.rotationalStiffness;
    spring.rotationalDamping = spec.rotationalDamping;
    spring.arm = a - b;
    spring.anchor = a;
    spring.length = spring.arm.norm();
    if (spec.kind == SpringKind::axial) {
      if (ground)
        throw SceneError(where + "node " + id(spec.a) +
                         ": an axial spring to its own start position has no "
                         "direction; use kind = \"bushing\"");
      if (!(spring.length > 0))
        throw SceneError(where + "nodes " + id(spec.a) + " and " + id(spec.b) +
                         " are at the same place; an axial spring needs two distinct positions");
    } else if (spec.kind == SpringKind::beam) {
      if (ground)
        throw SceneError(where + "node " + id(spec.a) +
                         ": a beam to its own start position has no "
                         "direction; use kind = \"bushing\"");
      if (!(spring.length > 0))
        throw SceneError(where + "nodes " + id(spec.a) + " and " + id(spec.b) +
                         " are at the same place; a beam needs two distinct positions");
      if (!axesOfBeam(spec, spring))
        throw SceneError(where + "its orientation is parallel to the line between nodes " + id(spec.a) + " and " +
                         id(spec.b));
      for (const auto& [node, end] : {std::pair{spec.a, &spring.a}, std::pair{spec.b, &spring.b}}) {
        if (!canTurn(*end)) throw SceneError(where + cannotTurn(node, *end));
        orient(*end);
      }
    } else {
      const bool torsion = !spec.rotationalStiffness.isZero(0) || !spec.rotationalDamping.isZero(0);
      for (const auto& [node, end] : {std::pair{spec.a, &spring.a}, std::pair{spec.b, &spring.b}})
        if (torsion && node >= 0) {
          if (!canTurn(*end)) throw SceneError(where + cannotTurn(node, *end));
          orient(*end);
        }
      if (!ground && spring.length > 0) {
        if (canTurn(spring.b))
          orient(spring.b);
        else if (!fixedNode(spring.b))
          warn(where + (bound[spec.b] ? "slave " : "node ") + id(spec.b) +
               " cannot turn: the moment of the shear force over the distance " + length(spring.length) +
               " is not balanced");
      }
    }
    model.springs.push_back(spring);
  }
}

bool Compilation::fixedNode(const SpringEnd& end) const {
  if (end.node < 0) return false;
  const auto in = [&](int g) { return end.node >= model.begin[g] && end.node < model.begin[g + 1]; };
  return in(rotatingFixedMaster) || in(rotatingFixedPoint) || in(fixedMaster) || in(fixedPoint);
}

std::string Compilation::cannotTurn(int node, const SpringEnd& end) const {
  if (end.slave < 0)
    return "node " + id(node) +
           " has no rotations for the rotational stiffness or damping to act on; "
           "give it rotations = true";
  const Bond& b = bonds[end.slave];
  return "slave " + id(node) + " cannot take a moment: the nodes of segment " + segmentId(b.segment) + " of tie '" +
         scene.ties[b.tie].name + "' have no rotations; use formulation = \"optimized\"";
}

}  // namespace tiefmu
