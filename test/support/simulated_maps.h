#pragma once
// Maps of simulated robots: at the true poses, or made by the engine `graph`.

#include <mapweave/laser/graph_mapper.h>
#include <mapweave/laser/submap_cutter.h>
#include <support/simulated_inputs.h>

namespace mapweave::test {

inline SessionId session_of(const simulation::SimulatedRobot& robot) {
  return {{robot.id, SensorId("laser")}, robot.steps.front().stamp.ns};
}

// In the frame of the robot's first pose.
inline Map truth_map(const simulation::SimulatedRobot& robot, const simulation::SimulatedLaserOptions& laser) {
  const auto geometry = scan_geometry(laser);
  std::vector<laser::TrackedScan> scans;
  for (const auto& step : robot.steps)
    scans.push_back({step.stamp, packed(step.ranges, geometry),
                     between(robot.steps.front().world_from_robot, step.world_from_robot), std::nullopt});
  return laser::cut_into_submaps(MapId(robot.id.str()), session_of(robot), std::move(scans));
}

inline Map mapped(const simulation::SimulatedRobot& robot, const std::shared_ptr<const ScanGeometry>& geometry,
                  bool with_odometry = true, const laser::GraphMapperOptions& options = {}) {
  laser::GraphMapper mapper({robot.id, SensorId("laser")}, options);
  for (const auto& step : robot.steps) {
    if (with_odometry) mapper.add(laser::OdometryInput{step.stamp, spatial(step.odometry_from_robot)});
    mapper.add(laser::ScanInput{step.stamp, packed(step.ranges, geometry)});
  }
  mapper.finish();
  return mapper.snapshot();
}
inline Map mapped(const simulation::SimulatedRobot& robot, const simulation::SimulatedLaserOptions& laser,
                  bool with_odometry = true, const laser::GraphMapperOptions& options = {}) {
  return mapped(robot, scan_geometry(laser), with_odometry, options);
}

// Root mean square distance of the nodes from the truth, the first node laid on it. The map must hold one node per
// step.
inline double error_m(const Map& map, const simulation::SimulatedRobot& robot) {
  double sum = 0.0;
  std::size_t i = 0;
  for (const auto& [id, node] : map.nodes) {
    const Pose2 truth = between(robot.steps.front().world_from_robot, robot.steps.at(i).world_from_robot);
    const Pose2 pose = planar(node.map_from_node);
    sum += (pose.x - truth.x) * (pose.x - truth.x) + (pose.y - truth.y) * (pose.y - truth.y);
    ++i;
  }
  return std::sqrt(sum / static_cast<double>(map.nodes.size()));
}

}  // namespace mapweave::test
