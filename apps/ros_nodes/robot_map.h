#pragma once
// A robot's own map, alone and as a preview has it.

#include <mapweave/core/stamped_pose.h>
#include <mapweave/runtime/live_preview.h>

#include <optional>
#include <vector>

namespace mapweave::ros_nodes {

// The frame of the robot's own map is where the robot stood first: its earliest pose is the identity there, as in
// exporters' recordings of ROS. It moves in a part when that pose does.
struct RobotMap {
  Map map;                              // the robot's nodes alone
  std::vector<StampedPose> trajectory;  // by stamp; at least one pose
  std::size_t part = 0;                 // of the preview: the one that has the robot's newest pose
  Pose3 part_from_robot_map;
};

// Of a map that a robot made alone (runtime::LiveEdge::map_so_far), as if it were the only part. nullopt: it has no
// pose of that robot.
std::optional<RobotMap> robot_map(const Map& own, const RobotId&);
// nullopt: no part has a pose of that robot.
std::optional<RobotMap> robot_map(const runtime::LivePreview&, const RobotId&);

// Whether two maps have the same nodes, with what was sensed there and the same poses: then they look the same.
bool looks_the_same(const Map&, const Map&);

}  // namespace mapweave::ros_nodes
