#pragma once
// Robots' own maps, as topics and transforms of ROS, while they are made.

#include "ros_names.h"

#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/compose_grid.h>

#include <ros/ros.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::ros_nodes {

struct PublishedRobot {
  RobotId robot;
  // The name of its nav_msgs/Odometry, asked for until there is one. Where none comes, or not for a time, tf is asked.
  std::function<std::optional<std::string>()> odometry_topic;
  // In tf its odometry is the frame called odom, or odom with more behind it, above a frame of the robot: the names of
  // either begin with frame_prefix ("tb0/"; empty: it is the only robot). robot_frame: empty: the one below odometry.
  std::string frame_prefix, robot_frame;
};

struct RobotMapsOptions {
  std::vector<PublishedRobot> robots;  // whose own maps this program may publish; of all programs, one does of each
  fusion::ComposeOptions grid;
  double transforms_hz = 10.0;
};

// Topics (relative to the node handle's namespace; all can be remapped), ROBOT being a name of RosNames:
//   ROBOT/map          nav_msgs/OccupancyGrid        the robot's map so far, in frame ROBOT/map: where it stood first
//   ROBOT/map_updates  map_msgs/OccupancyGridUpdate  what changed of it (GridTopic says when)
//   ROBOT/path         nav_msgs/Path                 its nodes by stamp, in frame ROBOT/map
// All behave as latched, are made only while somebody subscribes, and are sent only where they changed. Walls that
// moved by less than half a cell may stay as they were drawn.
// Transforms (/tf): ROBOT/map -> the robot's odometry frame, as far as it is known; the log says where it is not. The
// odometry frames of two robots must have different names; the second robot of one name gets no transform.
// Needs the node's callback queue to be served by other threads than the one that publishes.
class RobotMapsPublisher {
 public:
  // A robot's map as it is now, whose frame does not count (runtime::LiveEdge::map_so_far); null: it has none, or
  // another program publishes it now.
  using MapOf = std::function<std::shared_ptr<const Map>(const RobotId&)>;

  // pool must outlive it.
  RobotMapsPublisher(ros::NodeHandle node, RosNames names, RobotMapsOptions options, MapOf map_of, WorkerPool& pool);
  ~RobotMapsPublisher();

  // Call it again and again, where no map changed too: who subscribed meanwhile gets what was not made before, and
  // odometry that came late counts. Paths come before grids, which take a while where a large map has moved; so never
  // from a callback. One thread at a time. Problems of single messages (a map that extends too far, a stamp that ROS
  // cannot hold) are logged, and the others go out.
  void publish();

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::ros_nodes
