#pragma once
// Transforms that are sent again and again, as tf needs them.

#include <geometry_msgs/TransformStamped.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>

#include <mutex>
#include <vector>

namespace mapweave::ros_nodes {

// Sends from a timer of the node's callback queue, in ROS time (simulated where /use_sim_time is set). A transform's
// stamp is one period ahead, so that one is known at any time until the next comes (as amcl and gmapping do).
// All calls are thread-safe.
class TransformSender {
 public:
  TransformSender(ros::NodeHandle node, double rate_hz);
  // What is sent from now on; stamps are not looked at.
  void set(std::vector<geometry_msgs::TransformStamped> transforms);

 private:
  void send();

  const ros::Duration period_;
  tf2_ros::TransformBroadcaster broadcaster_;
  std::mutex mutex_;
  std::vector<geometry_msgs::TransformStamped> transforms_;
  ros::Time sent_;
  ros::Timer timer_;  // the last member: it ends before what it uses
};

}  // namespace mapweave::ros_nodes
