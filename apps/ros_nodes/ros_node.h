#pragma once
// A program of mapweave as a node of ROS.

#include <mapweave/core/error.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <stop_signals.h>

#include <chrono>
#include <optional>
#include <string>

namespace mapweave::ros_nodes {

// Whether the node of this name is one: what it publishes is no sensor's.
bool is_node_of_mapweave(const std::string& node);

// Waits for the ROS master, in any order of starting; callbacks come on a thread of its own. To be made after
// app::StopSignals. Throws Interrupted where the user does not wait any longer.
class RosNode {
 public:
  explicit RosNode(app::StopSignals& stops);
  ~RosNode();
  RosNode(const RosNode&) = delete;
  RosNode& operator=(const RosNode&) = delete;

  ros::NodeHandle& handle() { return *handle_; }
  // Whether the master was started again since the last call, and knows nothing of this node: who publishes, subscribes
  // or serves has to do it anew. Asks it once a second.
  bool is_forgotten();

 private:
  std::optional<ros::NodeHandle> handle_;
  std::optional<ros::AsyncSpinner> spinner_;
  std::chrono::steady_clock::time_point next_{};
};

}  // namespace mapweave::ros_nodes
