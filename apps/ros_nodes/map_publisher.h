#pragma once
// The maps that a tier merged, as topics and transforms of ROS.

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

struct MapPublisherOptions {
  std::string tier;                 // whose maps they are, an id; its name is the prefix of its topics
  std::string team_frame = "team";  // of the tier's largest part; each tier has one of its own
  TeamTransforms team_transforms = TeamTransforms::above;
  std::vector<RobotId> robots;  // whose own maps this program publishes as well
  fusion::ComposeOptions grid;
  exporters::PointCloudOptions cloud;
  double transforms_hz = 10.0;
};

// Topics (relative to the node handle's namespace; all can be remapped), TIER being a name of RosNames:
//   TIER/map     nav_msgs/OccupancyGrid          the largest part, in the team frame
//   TIER/cloud   sensor_msgs/PointCloud2         its walls and landmarks
//   TIER/graph   visualization_msgs/MarkerArray  its pose graph
//   TIER/map_updates  map_msgs/OccupancyGridUpdate  what changed of the grid (GridTopic says when)
// All behave as latched, are made only while somebody subscribes, and are sent only where they changed.
// Transforms (/tf): TeamTransforms, as far as they are known.
// Needs the node's callback queue to be served by other threads than the one that publishes.
class MapPublisher {
 public:
  // pool must outlive it. Throws Error(kBadInput) where a robot has the name of the tier.
  MapPublisher(ros::NodeHandle node, RosNames names, MapPublisherOptions options, WorkerPool& pool);
  ~MapPublisher();

  // Call it again and again, with the same preview too: who subscribed meanwhile gets what was not made before. Takes a
  // second or two where grids are large, so never from a callback; one thread at a time. null: nothing. Problems of
  // single messages (a map that extends too far, a stamp that ROS cannot hold) are logged, and the others go out.
  void publish(const std::shared_ptr<const runtime::LivePreview>& preview);

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::ros_nodes
