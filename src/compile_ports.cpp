// Ports to their nodes or slaves.
#include <Eigen/Eigenvalues>
#include <algorithm>

#include "compilation.hpp"
#include "port.hpp"

namespace tiefmu {
namespace {

// The shortest w with J w = l, J the inertia of arms: nodes on a line say nothing of a turn about it.
Vec3 leastTurn(const Mat3& j, const Vec3& l) {
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(j);
  Vec3 w = Vec3::Zero();
  for (int i = 0; i < 3; ++i)
    if (eigen.eigenvalues()[i] * conditionRefused > eigen.eigenvalues()[2])
      w += eigen.eigenvectors().col(i).dot(l) / eigen.eigenvalues()[i] * eigen.eigenvectors().col(i);
  return w;
}

}  // namespace

// Those of driven nodes first.
void Compilation::placePorts() {
  for (const bool ofSlaves : {false, true})
    for (int k = 0; k < static_cast<int>(scene.ports.size()); ++k) placePort(k, ofSlaves);
}

// Finds the nodes of the port in the model; keeps it if it is one of slaves, or of driven nodes, as asked.
void Compilation::placePort(int k, bool ofSlaves) {
  const ScenePort& spec = scene.ports[k];
  const std::string where = "interface: port '" + spec.name + "': ";
  Port port;
  port.name = spec.name;
  port.number = k + 1;
  int slave = -1, other = -1;
  for (int node : spec.nodes) {
    if (!bound[node] && nodeIndex[node] < 0) {
      if (spec.listed) throw SceneError(where + "node " + id(node) + ": no tie and no spring uses it");
      continue;
    }
    (bound[node] ? slave : other) = node;
    if (!bound[node] && scene.nodes.motion[node] != Motion::driven)
      throw SceneError(where + "node " + id(node) + ": is " +
                       (scene.nodes.motion[node] == Motion::free ? "free" : "fixed") +
                       "; a port moves driven nodes or loads slaves");
    if (slave >= 0 && other >= 0)
      throw SceneError(where + "holds slaves (node " + id(slave) + ") and nodes that are none (node " + id(other) +
                       "); make two ports of them");
    port.member.push_back(bound[node] ? slaveIndex[node] : nodeIndex[node]);
  }
  if (port.member.empty()) throw SceneError(where + "no tie and no spring uses any of its nodes");
  port.ofSlaves = slave >= 0;
  if (port.ofSlaves != ofSlaves) return;
  if (port.member.size() < spec.nodes.size())
    note(where + std::to_string(spec.nodes.size() - port.member.size()) + " of " + std::to_string(spec.nodes.size()) +
         " nodes left out: no tie and no spring uses them");
  std::sort(port.member.begin(), port.member.end());
  const auto position = [&](int member) {
    return port.ofSlaves ? scene.nodes.position[bonds[member].slave] : Vec3(at(model.nodePosition.data(), member));
  };
  Vec3 mean = Vec3::Zero();
  for (int member : port.member) mean += position(member) / static_cast<double>(port.member.size());
  port.place = spec.atMean ? mean : spec.at;
  if (port.ofSlaves) port.lever = port.place - mean;
  for (int member : port.member) {
    const Vec3 arm = position(member) - (port.ofSlaves ? mean : port.place);
    port.arm.insert(port.arm.end(), arm.begin(), arm.end());
  }
  if (port.ofSlaves)
    resolveTurn(port, where);
  else
    startMotion(port, where);
  model.ports.push_back(std::move(port));
}

// Slaves on a line leave the rotation about it open; their own rotations decide it.
void Compilation::resolveTurn(Port& port, const std::string& where) {
  const Vec3 eigenvalue = armInertia(port.arm).selfadjointView<Eigen::Lower>().eigenvalues();
  if (eigenvalue[0] * conditionRefused >= eigenvalue[2] && eigenvalue[2] > 0) return;
  const bool turning =
      std::any_of(port.member.begin(), port.member.end(), [&](int s) { return s < model.turningSlaves; });
  if (!turning)
    throw SceneError(where + (port.member.size() > 1 ? "its slaves are collinear and" : "its only slave") +
                     " cannot turn, which leaves its rotation open; use formulation = \"optimized\" or "
                     "rotations = true");
  const double mean2 = 0.5 * eigenvalue.sum() / static_cast<double>(port.member.size());
  port.turnWeight = mean2 > 0 ? mean2 : 1;
  if (port.lever.isZero(0) || !model.finite()) return;
  for (int s : port.member) {
    SpringEnd end;
    end.slave = s;
    if (s < model.turningSlaves) orient(end);
    port.orientation.push_back(end.orientation);
  }
}

// The port's velocities at the start from those of its nodes, which must move as one body.
void Compilation::startMotion(Port& port, const std::string& where) {
  const std::size_t count = port.member.size();
  Vec3 meanArm = Vec3::Zero(), meanVelocity = Vec3::Zero(), turn = Vec3::Zero();
  double speed = 0;
  for (std::size_t i = 0; i < count; ++i) {
    meanArm += at(port.arm.data(), i) / static_cast<double>(count);
    meanVelocity += at(model.nodeVelocity.data(), port.member[i]) / static_cast<double>(count);
    speed = std::max(speed, at(model.nodeVelocity.data(), port.member[i]).norm());
  }
  std::vector<double> arm = port.arm;
  for (std::size_t i = 0; i < count; ++i) {
    at(arm.data(), i) -= meanArm;
    turn += at(arm.data(), i).cross(at(model.nodeVelocity.data(), port.member[i]));
  }
  const int rotating = *std::min_element(port.member.begin(), port.member.end());
  if (rotating < model.rotating())
    port.spin = at(model.nodeSpin.data(), rotating);
  else if (!turn.isZero(0))
    port.spin = leastTurn(armInertia(arm), turn);
  port.velocity = meanVelocity - port.spin.cross(meanArm);
  for (std::size_t i = 0; i < count; ++i) {
    const int node = port.member[i];
    const Vec3 v = port.velocity + port.spin.cross(at(port.arm.data(), i));
    const bool turnsElse = node < model.rotating() && !(at(model.nodeSpin.data(), node) == port.spin);
    if (turnsElse || !((v - at(model.nodeVelocity.data(), node)).norm() <= 1e-9 * speed))
      throw SceneError(where + "node " + std::to_string(model.nodeId[node]) +
                       ": its [[initial]] velocity does not fit a rigid motion of the port's nodes");
  }
}

}  // namespace tiefmu
