// What the stages of `compile` share. Each stage is a file compile_*.cpp (bind.cpp for the first) and reads what the
// stages before it have written.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bind.hpp"
#include "model.hpp"
#include "partition.hpp"
#include "scene_view.hpp"

namespace tiefmu {

constexpr double conditionRefused = 1e12;  // of Ibar: from here on its nodes (slaves) count as collinear

class Compilation : SceneView {
 public:
  explicit Compilation(const Scene& s) : SceneView(s) {}
  Model run();

 private:
  Model model;

  std::vector<Bond> bonds;  // from bindSlaves; sorted by placeSlaves

  // compile_couplings.cpp
  void chooseCouplings();
  void resolveRotations();
  std::vector<std::uint8_t> bound;   // per scene node: is a slave of the model
  std::vector<std::uint8_t> master;  // per scene node
  std::vector<std::uint8_t> turns;   // per scene node: rotational freedom that the model keeps

  // compile_nodes.cpp
  void placeNodes();
  std::vector<int> nodeIndex;  // per scene node: index in the model, or -1

  // compile_slaves.cpp
  void placeSlaves();
  void sortBonds();
  std::vector<int> slaveIndex;       // per scene node: index in the model, or -1
  std::vector<int> segmentRotation;  // per slave of the model: index of its meanMotion segment, or -1
  std::vector<Partition> parts;      // per group
  int meanMotionSegments = 0;

  // compile_springs.cpp
  void placeSprings();
  bool canTurn(const SpringEnd& end) const;
  bool fixedNode(const SpringEnd& end) const;
  std::string cannotTurn(int node, const SpringEnd& end) const;
  void orient(SpringEnd& end);
  std::vector<int> orientationOfSlave, orientationOfNode;  // per slave and node of the model: quaternion, or -1

  // compile_ports.cpp
  void placePorts();
  void placePort(int k, bool ofSlaves);
  void resolveTurn(Port& port, const std::string& where);
  void startMotion(Port& port, const std::string& where);

  void adviseOnInertia();

  void warn(std::string line) { model.findings.push_back({Finding::warning, std::move(line)}); }
  void note(std::string line) { model.findings.push_back({Finding::note, std::move(line)}); }
};

}  // namespace tiefmu
