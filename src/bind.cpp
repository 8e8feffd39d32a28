#include "bind.hpp"

#include "scene_view.hpp"
#include "search.hpp"

namespace tiefmu {
namespace {

class Binder : SceneView {
 public:
  Binder(const Scene& s, Model& m) : SceneView(s), model(m) {}

  std::vector<Bond> run() {
    claimSlaves();
    for (int t = 0; t < static_cast<int>(scene.ties.size()); ++t) bindTie(t);
    return std::move(bonds);
  }

 private:
  Model& model;
  std::vector<Bond> bonds;
  std::vector<int> tieOf;  // per scene node: the tie it is a slave of, or -1

  void warn(std::string line) { model.findings.push_back({Finding::warning, std::move(line)}); }

  // No slave in two ties, none that is also a master.
  void claimSlaves() {
    tieOf.assign(scene.nodes.id.size(), -1);
    for (int t = 0; t < static_cast<int>(scene.ties.size()); ++t)
      for (int s : scene.ties[t].slaves) {
        if (tieOf[s] >= 0)
          throw SceneError(tie(t) + "slave " + id(s) + ": is already a slave of tie '" + scene.ties[tieOf[s]].name +
                           "'; a node can follow one tie only");
        tieOf[s] = t;
      }
    for (int t = 0; t < static_cast<int>(scene.ties.size()); ++t)
      for (int e : scene.ties[t].segments)
        for (int i = 0; i < corners(e); ++i) {
          const int node = scene.segments.nodes[e][i];
          if (tieOf[node] >= 0)
            throw SceneError(tie(tieOf[node]) + "slave " + id(node) + ": is also a master, on segment " + segmentId(e) +
                             " of tie '" + scene.ties[t].name + "'; take it out of one of them");
        }
  }

  void bindTie(int t) {
    const SceneTie& spec = scene.ties[t];
    std::vector<std::array<int, 4>> nodes;
    std::vector<std::int64_t> ids;
    for (int e : spec.segments) {
      nodes.push_back(scene.segments.nodes[e]);
      ids.push_back(scene.segments.id[e]);
    }
    const SegmentSearch search(scene.nodes.position, std::move(nodes), std::move(ids));
    std::string passedOver;
    for (int k : search.zeroArea()) {
      warn(tie(t) + "segment " + segmentId(spec.segments[k]) +
           ": has no area (its nodes coincide, are collinear or fold onto each other); passed over");
      passedOver += (passedOver.empty() ? "" : ", ") + segmentId(spec.segments[k]);
    }
    const double distance = spec.searchDistance > 0 ? spec.searchDistance : search.defaultDistance();
    model.searchDistance.push_back(distance);
    for (int s : spec.slaves) {
      const Vec3& x = scene.nodes.position[s];
      const Match match = spec.search == SearchMethod::box ? search.box(x, distance) : search.nearestNode(x, distance);
      if (match.segment < 0) {
        unresolved(t, s, match, distance, search, passedOver);
        continue;
      }
      const int e = spec.segments[match.segment];
      const std::string where = tie(t) + "slave " + id(s) + ": ";
      if (match.projection.outside > SegmentSearch::warnOutside)
        warn(where + "lies outside segment " + segmentId(e) + " (xi = " + text(match.projection.xi) +
             ", eta = " + text(match.projection.eta) + "); its inertia uses the projection clamped to the segment");
      if (match.unconverged >= 0)
        warn(where + "the projection on segment " + segmentId(spec.segments[match.unconverged]) +
             " did not converge; the segment was passed over");
      bonds.push_back({s, t, e, corners(e), Coupling::translation, match.projection, x - match.projection.point});
    }
  }

  void unresolved(int t, int s, const Match& match, double distance, const SegmentSearch& search,
                  const std::string& passedOver) {
    const bool box = scene.ties[t].search == SearchMethod::box;
    // Far away: how far tells the user what to change.
    const Match far = search.box(scene.nodes.position[s], 1e6 * distance);
    std::string line = tie(t) + "slave " + id(s) + ": no segment found ";
    line += box ? "within search_distance " + text(distance) + " m"
                : "at its nearest master node in the box of side search_distance " + text(distance) + " m";
    if (far.segment >= 0)
      line += "; the nearest is segment " + segmentId(scene.ties[t].segments[far.segment]) + " at " +
              text(far.distance) + " m";
    else
      line += "; it lies outside every segment by more than half its size";
    if (!passedOver.empty()) line += "; without area and passed over: segment " + passedOver;
    if (match.unconverged >= 0)
      line +=
          "; the projection on segment " + segmentId(scene.ties[t].segments[match.unconverged]) + " did not converge";
    if (!scene.ties[t].dropUnresolved) throw SceneError(line);
    warn(line + "; dropped");
    model.dropped.push_back({scene.nodes.id[s], t, line.substr(line.find("no segment"))});
  }
};

}  // namespace

std::vector<Bond> bindSlaves(const Scene& scene, Model& model) {
  for (const SceneTie& tie : scene.ties) model.tieName.push_back(tie.name);
  return Binder(scene, model).run();
}

}  // namespace tiefmu
