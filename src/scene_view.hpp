// A scene as the stages of `compile` read it: segments' corners, and how messages call things.
#pragma once

#include <string>

#include "scene.hpp"
#include "text.hpp"

namespace tiefmu {

struct SceneView {
  explicit SceneView(const Scene& s) : scene(s) {}
  const Scene& scene;

  std::string id(int node) const { return std::to_string(scene.nodes.id[node]); }
  std::string segmentId(int e) const { return std::to_string(scene.segments.id[e]); }
  // In the scene's own units.
  std::string length(double metres) const { return text(metres / scene.length.si) + " " + scene.length.name; }
  std::string mass(double kilograms) const { return text(kilograms / scene.mass.si) + " " + scene.mass.name; }
  std::string tie(int t) const { return "tie '" + scene.ties[t].name + "': "; }
  int corners(int e) const { return scene.segments.nodes[e][3] < 0 ? 3 : 4; }
  // Positions of the corners of segment e (m) to x; returns how many.
  int gather(int e, Vec3* x) const {
    const int n = corners(e);
    for (int i = 0; i < n; ++i) x[i] = scene.nodes.position[scene.segments.nodes[e][i]];
    return n;
  }
};

}  // namespace tiefmu
