#pragma once
// Maps of single cameras, whose lengths are their own, in metres. Where a camera sits on its robot is known in metres whatever lengths its
// map has: what grows is the way of the camera and what it sees from there, not the robot under it.

#include "visual_witness.h"

namespace mapweave::fusion {

// Where the camera sits by whose way a map grows: of its first keyframe. The map of a rig grows as one, or its cameras would part that are
// on one robot whatever their lengths. The identity where there is no keyframe.
Pose3 mounting_of(const Map& map);

// Where a node is once the map's lengths are `scale` times as long. The robot stays where the map begins, at the origin. Between nodes: the
// way of the robot from the one to the other.
Pose3 in_lengths(const Pose3& map_from_node, const Pose3& robot_from_camera, double scale);
Map in_lengths(Map map, double scale);
// The way of the camera that `constraint` begins at; it is one of the map's.
Constraint in_lengths(Constraint constraint, const Map& map, double scale);
// Where a point is that the camera saw, in the frame of its robot.
Eigen::Vector3d in_lengths(const Eigen::Vector3d& point_in_anchor, const Pose3& robot_from_camera, double scale);

// Where a node is in the frame into which `there_from_map` takes the map's cameras and landmarks. With lengths as they are the same as
// transformed(map_from_node, there_from_map), to the bit.
Pose3 carried(const Sim3& there_from_map, const Pose3& map_from_node, const Pose3& robot_from_camera);
// The way back: what of there_from_map is no scale, of which one node of the map and its place there tell.
Pose3 frame_there(const Pose3& there_from_node, const Pose3& map_from_node, const Pose3& robot_from_camera, double scale);

// node_a_from_node_b in metres, of maps whose lengths become `scale_a` and `scale_b` times as long.
struct MetricWitness {
  Pose3 node_a_from_node_b;
  Eigen::Matrix<double, 6, 6> information;
};
MetricWitness in_lengths(const VisualWitness&, const VisualMap& a, const VisualMap& b, double scale_a, double scale_b);

}  // namespace mapweave::fusion
