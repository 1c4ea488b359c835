#pragma once
// Converts monocular maps of unknown scale to metres. The extrinsics of a camera are in metres whatever the scale of
// its map: the camera's trajectory and the landmarks are rescaled, the robot under the camera is not.

#include <mapweave/maps/map.h>

namespace mapweave::rig {

// Whether the keyframes measured depth. Otherwise the scale of the map is unknown.
bool is_metric(const Map&);

// robot_from_camera of the map's first keyframe. The map of a rig is rescaled as a whole by the trajectory of this
// camera: its cameras would part otherwise. Identity where there is no keyframe.
Pose3 extrinsics_of(const Map& map);

// map_from_node after the camera's trajectory is rescaled. The robot stays where the map begins, at the origin. Also
// for the motion of the robot from one node to another.
Pose3 rescaled(const Pose3& map_from_node, const Pose3& robot_from_camera, double scale);
Map rescaled(Map map, double scale);
// `constraint` is one of the map's; its motion is that of the camera of its first node.
Constraint rescaled(Constraint constraint, const Map& map, double scale);
// A point that the camera saw, in the frame of its robot.
Eigen::Vector3d rescaled(const Eigen::Vector3d& point_in_anchor, const Pose3& robot_from_camera, double scale);

// there_from_node, where there_from_map transforms the map's cameras and landmarks. With scale 1 the same as
// transformed(map_from_node, there_from_map), to the bit.
Pose3 moved_with_camera(const Sim3& there_from_map, const Pose3& map_from_node, const Pose3& robot_from_camera);
// The inverse problem: the pose of there_from_map, from the two poses of one node and the scale.
Pose3 frame_by_node(const Pose3& there_from_node, const Pose3& map_from_node, const Pose3& robot_from_camera,
                    double scale);

}  // namespace mapweave::rig
