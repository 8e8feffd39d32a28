#include "bind.hpp"

#include <algorithm>

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
    if (bonds.empty() && !model.dropped.empty()) {
      const Dropped& first = model.dropped.front();
      throw SceneError(tie(first.tie) + "all its slaves are dropped (slave " + std::to_string(first.id) + ": " +
                       first.reason + "), which leaves nothing to model: an FMU without variables is of no use");
    }
    return std::move(bonds);
  }

 private:
  Model& model;
  std::vector<Bond> bonds;
  std::vector<int> tieOf;  // per scene node: the tie it is a slave of, or -1

  void warn(std::string line) { model.findings.push_back({Finding::warning, std::move(line)}); }
  void note(std::string line) { model.findings.push_back({Finding::note, std::move(line)}); }

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
    const int count = static_cast<int>(spec.slaves.size());
    std::vector<std::array<int, 4>> nodes;
    std::vector<std::int64_t> ids;
    for (int e : spec.segments) {
      refuseRepeated(t, e);
      nodes.push_back(scene.segments.nodes[e]);
      ids.push_back(scene.segments.id[e]);
    }
    const SegmentSearch search(scene.nodes.position, std::move(nodes), std::move(ids));
    for (int k : search.zeroArea())
      warn(tie(t) + "segment " + segmentId(spec.segments[k]) +
           ": has no area (its nodes coincide, are collinear or fold onto each other); passed over");
    const double reach = spec.searchDistance > 0 ? spec.searchDistance : search.defaultReach(spec.search);
    model.searchDistance.push_back(reach);

    std::vector<Vec3> places;
    places.reserve(count);
    for (int s : spec.slaves) places.push_back(scene.nodes.position[s]);
    std::vector<Bond> found(count);
    std::vector<std::pair<int, Match>> toTell;  // in the order of the tie
    search.each(spec.search, places, reach, [&](int k, Match& match) {
      const int e = match.segment < 0 ? -1 : spec.segments[match.segment];
      if (e < 0 || match.rival >= 0 || match.folded >= 0 || match.projection.outside > SegmentSearch::warnOutside)
        toTell.emplace_back(k, match);
      if (e >= 0) withoutNoise(e, places[k], match.projection);
      found[k] = {spec.slaves[k],         t, e, e < 0 ? 0 : corners(e), Coupling::translation, match.projection,
                  match.projection.offset};
    });
    std::sort(toTell.begin(), toTell.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<int> used;
    for (const auto& [k, match] : toTell) {
      if (match.segment < 0)
        unresolved(t, spec.slaves[k], match, reach, search);
      else
        tell(t, spec.slaves[k], match);
      if (match.crossing >= 0) used.push_back(match.crossing);
    }
    for (int k : search.crossing())
      if (std::find(used.begin(), used.end(), k) == used.end())
        note(tie(t) + "segment " + segmentId(spec.segments[k]) + ": crosses itself (its nodes are not in order round " +
             "it); no slave would use it");
    std::erase_if(found, [](const Bond& b) { return b.segment < 0; });
    if (bonds.empty())
      bonds = std::move(found);
    else
      bonds.insert(bonds.end(), found.begin(), found.end());
  }

  void refuseRepeated(int t, int e) {
    const auto& nodes = scene.segments.nodes[e];
    for (int i = 0; i < corners(e); ++i)
      for (int j = 0; j < i; ++j)
        if (nodes[i] == nodes[j])
          throw SceneError(tie(t) + "segment " + segmentId(e) + ": repeats node " + id(nodes[i]) +
                           "; only the third and fourth node of a triangle may be the same");
  }

  // An offset that rounding alone can make counts as none: it would give rotations an inertia of next to nothing.
  void withoutNoise(int e, const Vec3& slave, Projection& p) const {
    Vec3 x[5];
    const int n = gather(e, x);
    x[n] = slave;
    double size = 0;
    for (int i = 1; i < n; ++i) size = std::max(size, (x[i] - x[0]).norm());
    if (p.distance > std::max(1e-12 * size, coordinateNoise(n + 1, x))) return;
    p.offset.setZero();
    p.distance = 0;
  }

  void tell(int t, int s, const Match& match) {
    const auto name = [&](int k) { return "segment " + segmentId(scene.ties[t].segments[k]); };
    const std::string where = tie(t) + "slave " + id(s) + ": ";
    const Projection& p = match.projection;
    if (p.outside > SegmentSearch::warnOutside)
      warn(where + "lies outside " + name(match.segment) + " (xi = " + text(p.xi) + ", eta = " + text(p.eta) + ")" +
           (scene.ties[t].formulation == Formulation::standard
                ? "; its inertia uses the projection clamped to the segment"
                : ""));
    if (match.folded >= 0)
      warn(where + name(match.folded) + " is nearer, but folds onto itself there (one of its corners points inward); " +
           "passed over");
    if (match.rival >= 0)
      warn(where + "is as near to " + name(match.rival) + " as to " + name(match.segment) + ", which it is tied to (" +
           length(p.nearest) + ")");
  }

  void unresolved(int t, int s, const Match& match, double reach, const SegmentSearch& search) {
    const SceneTie& spec = scene.ties[t];
    const auto name = [&](int k) { return "segment " + segmentId(spec.segments[k]); };
    const std::string where = tie(t) + "slave " + id(s) + ": ";
    std::string line = "no segment found ";
    line += spec.search == SearchMethod::box ? "within" : "at its nearest master node within";
    line += " search_distance " + length(reach);
    // Why the nearest one is none tells the user what to change.
    const Match near = search.nearest(scene.nodes.position[s]);
    if (match.crossing >= 0) {
      line +=
          "; the nearest is " + name(match.crossing) + ", which crosses itself (its nodes are not in order round it)";
    } else if (near.segment >= 0) {
      const Projection& p = near.projection;
      line += "; the nearest is " + name(near.segment) + " at " + length(p.nearest);
      if (near.crossing >= 0)
        line += ", which crosses itself (its nodes are not in order round it)";
      else if (p.folded)
        line += ", which folds onto itself there (one of its corners points inward)";
      else if (!(p.outside <= SegmentSearch::maxOutside))
        line += ", but the slave lies beyond its edge by more than a quarter of its size (|xi| or |eta| above 1.5)";
    }
    std::string passedOver;
    for (int k : search.zeroArea()) passedOver += (passedOver.empty() ? "" : ", ") + segmentId(spec.segments[k]);
    if (!passedOver.empty()) line += "; without area and passed over: segment " + passedOver;
    if (!spec.dropUnresolved) throw SceneError(where + line);
    warn(where + line + "; dropped");
    model.dropped.push_back({scene.nodes.id[s], t, line});
  }
};

}  // namespace

std::vector<Bond> bindSlaves(const Scene& scene, Model& model) {
  for (const SceneTie& tie : scene.ties) model.tieName.push_back(tie.name);
  return Binder(scene, model).run();
}

}  // namespace tiefmu
