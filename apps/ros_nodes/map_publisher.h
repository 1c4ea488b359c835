#pragma once
// The maps of a tier, as topics and transforms of ROS.

#include "ros_names.h"

#include <mapweave/core/worker_pool.h>
#include <mapweave/exporters/point_cloud.h>
#include <mapweave/fusion/compose_grid.h>
#include <mapweave/runtime/live_preview.h>

#include <ros/ros.h>

#include <memory>
#include <string>
#include <vector>

namespace mapweave::ros_nodes {

// Where the team's frame hangs in the tree of transforms. A frame has one parent: of all programs of a system one may
// be `above`, the others are `below` or have none.
enum class TeamTransforms {
  above,  // team frame -> ROBOT/map, of each robot in the largest part
  below,  // ROBOT/map -> team frame, of the first of these robots
  none
};

struct PublishedRobot {
  RobotId robot;
  std::string odometry_topic;  // nav_msgs/Odometry; empty: its odometry is looked up in tf alone
  // What tf is asked where that topic does not come, or not for that time. Empty: ROBOT/odom and ROBOT/base_link.
  std::string odometry_frame, robot_frame;
};

struct MapPublisherOptions {
  std::string tier;                 // whose maps they are, an id; its name is the prefix of its topics
  std::string team_frame = "team";  // of the tier's largest part; each tier has one of its own
  TeamTransforms team_transforms = TeamTransforms::above;
  std::vector<PublishedRobot> robots;  // whose own maps this program publishes; of all programs, one does of each
  fusion::ComposeOptions grid;
  exporters::PointCloudOptions cloud;
  double transforms_hz = 10.0;
};

// Topics (relative to the node handle's namespace; all can be remapped), ROBOT and TIER being names of RosNames:
//   ROBOT/map    nav_msgs/OccupancyGrid          the robot's nodes alone, in frame ROBOT/map: where it stood first
//   ROBOT/path   nav_msgs/Path                   its nodes by stamp, in frame ROBOT/map
//   TIER/map     nav_msgs/OccupancyGrid          the largest part, in the team frame
//   TIER/cloud   sensor_msgs/PointCloud2         its walls and landmarks
//   TIER/graph   visualization_msgs/MarkerArray  its pose graph
//   .../map_updates  map_msgs/OccupancyGridUpdate  what changed of a grid (GridTopic says when)
// All behave as latched, are made only while somebody subscribes, and are sent only where they changed.
// Transforms (/tf): TeamTransforms, and ROBOT/map -> the robot's odometry frame, as far as they are known. The odometry
// frames of two robots must have different names; the second robot of one name gets no transform, and the log says so.
// Needs the node's callback queue to be served by other threads than the one that publishes.
class MapPublisher {
 public:
  // pool must outlive it. Throws Error(kBadInput) where a robot has the name of the tier.
  MapPublisher(ros::NodeHandle node, RosNames names, MapPublisherOptions options, WorkerPool& pool);
  ~MapPublisher();

  // Call it again and again, with the same preview too: who subscribed meanwhile gets what was not made before, and
  // odometry that came late counts. Takes a second or two where grids are large, so never from a callback; one thread
  // at a time. null: nothing. Problems of single messages (a map that extends too far, a stamp that ROS cannot hold)
  // are logged, and the others go out.
  void publish(const std::shared_ptr<const runtime::LivePreview>& preview);

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::ros_nodes
