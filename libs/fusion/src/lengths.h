#pragma once
// Maps of single cameras, whose lengths are their own, in metres. Where a camera sits on its robot is known in metres whatever lengths its
// map has: what grows is the way of the camera and what it sees from there, not the robot under it.

#include "visual_witness.h"

namespace mapweave::fusion {

// Where a node is once the map's lengths are `scale` times as long. The robot stays where the map begins, at the origin.
Pose3 in_lengths(const Pose3& map_from_node, const Pose3& robot_from_camera, double scale);
Map in_lengths(Map map, double scale);
// node_a_from_node_b in metres, of maps whose lengths become `scale_a` and `scale_b` times as long.
struct MetricWitness {
  Pose3 node_a_from_node_b;
  Eigen::Matrix<double, 6, 6> information;
};
MetricWitness in_lengths(const VisualWitness&, const VisualMap& a, const VisualMap& b, double scale_a, double scale_b);

}  // namespace mapweave::fusion
