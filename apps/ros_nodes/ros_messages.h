#pragma once
// Maps as messages of ROS 1: translation without any node. A message's own stamp is 0 (who sends it sets it); frames
// are those that the caller names. All functions are pure.

#include <mapweave/core/stamped_pose.h>
#include <mapweave/exporters/point_cloud.h>
#include <mapweave/maps/map.h>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/TransformStamped.h>
#include <map_msgs/OccupancyGridUpdate.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Path.h>
#include <sensor_msgs/PointCloud2.h>
#include <visualization_msgs/MarkerArray.h>

#include <nlohmann/json_fwd.hpp>

#include <optional>
#include <string>
#include <vector>

namespace mapweave::ros_nodes {

// Throws Error(kBadInput) for what ROS 1 cannot hold: before 1970, after 2106.
ros::Time ros_time(Stamp);
Stamp stamp_of(const ros::Time&);

geometry_msgs::Pose pose_message(const Pose3&);
geometry_msgs::Transform transform_message(const Pose3&);
geometry_msgs::TransformStamped transform_between(const std::string& parent, const std::string& child,
                                                  const Pose3& parent_from_child);
// The other direction; nullopt for numbers that are not finite, and for a quaternion far from unit length.
std::optional<Pose3> pose_of(const geometry_msgs::Pose&);
std::optional<Pose3> pose_of(const geometry_msgs::Transform&);

// 100 wall, 0 free, -1 unknown: what map_saver writes of it has the pixels of exporters::pgm_bytes().
nav_msgs::OccupancyGrid grid_message(const OccupancyGrid&, const std::string& frame);
// The smallest rectangle of cells that differ; of width and height 0 where none does. nullopt: size, resolution, origin
// or frame differ, so that the whole grid must be sent.
std::optional<map_msgs::OccupancyGridUpdate> grid_update(const nav_msgs::OccupancyGrid& before,
                                                         const nav_msgs::OccupancyGrid& now);

// Each pose with its own stamp, in the order given: exporters::robot_trajectories() has them by stamp. Throws as
// ros_time().
nav_msgs::Path path_message(const std::vector<StampedPose>&, const std::string& frame);

// Of exporters::map_cloud(): x, y, z (float32, metres) and rgb, 16 bytes a point.
sensor_msgs::PointCloud2 cloud_message(const std::vector<exporters::ColouredPoint>&, const std::string& frame);

// Always the same markers, each in a namespace (`ns`) of its own with id 0, so that a new array replaces the one
// before; one without content is deleted. nodes: spheres in their robots' colours. trajectories: lines between a
// session's consecutive nodes. odometry, scan_matches, extrinsics, loops: lines of constraints within a robot.
// between_maps: of constraints between maps or between robots. Constraints of nodes that the map does not hold are left
// out.
visualization_msgs::MarkerArray graph_message(const Map&, const std::string& frame);

// Of runtime::program_status(): one status per tier, "mapweave: ROLE NAME". ERROR and WARN where it has such findings,
// and its message is the first of them; else OK, and its message is the tier's state. Counts, links and findings are
// its values. STALE: a tier that cannot be read; where there is no status (null) or none of its tiers, one for the
// program.
diagnostic_msgs::DiagnosticArray diagnostics_message(const nlohmann::ordered_json& status);

}  // namespace mapweave::ros_nodes
