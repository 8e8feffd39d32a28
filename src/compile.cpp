#include "compile.hpp"

#include "compilation.hpp"

namespace tiefmu {

Model Compilation::run() {
  model.settings = scene.settings;
  if (scene.settings.inertia == Inertia::lumped && scene.settings.reaction == Reaction::split)
    throw SceneError("model: reaction: 'split' needs inertia = 'consistent' (with lumped inertia it equals 'loads')");
  if (scene.settings.reactionLead > 0 && scene.settings.reaction == Reaction::loads)
    throw SceneError("model: reaction_lead: 'loads' answers to no accelerations; it is for 'split' and 'full'");
  if (!scene.ports.empty() && scene.settings.position == Position::input)
    throw SceneError("interface: ports: need position = 'integrated' in [model]: a port's nodes move with the port");
  if (scene.settings.safety > 1)
    warn("integrator: safety = " + text(scene.settings.safety) +
         " lets steps be longer than the stability limit: expect the solution to diverge");
  bonds = bindSlaves(scene, model);
  chooseCouplings();
  resolveRotations();
  placeNodes();
  if (scene.settings.reactionLead > 0 && !model.anyDriven())
    throw SceneError("model: reaction_lead: no node is driven, so there is no host that holds a reaction");
  placeSlaves();
  placeSprings();
  placePorts();
  adviseOnInertia();
  return std::move(model);
}

// Without acceleration inputs the driven share of a consistent mass matrix has nothing to multiply.
void Compilation::adviseOnInertia() {
  if (scene.settings.inertia != Inertia::consistent || scene.settings.reaction != Reaction::loads) return;
  for (const Bond& b : bonds) {
    bool freeCorner = false, drivenCorner = false;
    for (int i = 0; i < b.corners; ++i) {
      const Motion motion = scene.nodes.motion[scene.segments.nodes[b.segment][i]];
      freeCorner |= motion == Motion::free;
      drivenCorner |= motion == Motion::driven;
    }
    if (freeCorner && drivenCorner && scene.nodes.mass[b.slave] + scene.nodes.inertia[b.slave] > 0) {
      warn(
          "model: reaction 'loads' gives no accelerations of the driven masters, so their share of the slaves' "
          "inertia does not act on the free masters of the same segment (first: segment " +
          segmentId(b.segment) + "); reaction = \"full\" or \"split\" does");
      return;
    }
  }
}

Model compile(const Scene& scene) { return Compilation(scene).run(); }

}  // namespace tiefmu
