#pragma once
// A program of mapweave as a node of ROS.

#include <ros/ros.h>
#include <ros/spinner.h>
#include <stop_signals.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

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
  // As NodeHandle::advertiseService.
  template <class Server, class Request, class Response>
  void serve(const std::string& name, bool (Server::*answer)(Request&, Response&), Server* server) {
    services_.push_back(handle_->advertiseService(name, answer, server));
  }
  // Now and then: where the master was started again, registers with it what this node publishes, subscribes to and
  // serves. Connections that are there stay.
  void keep();
  void stop() { spinner_->stop(); }  // no callback runs any more, once it returns

 private:
  void register_again() const;

  std::optional<ros::NodeHandle> handle_;
  std::optional<ros::AsyncSpinner> spinner_;
  std::vector<ros::ServiceServer> services_;
  std::chrono::steady_clock::time_point next_{};
};

}  // namespace mapweave::ros_nodes
