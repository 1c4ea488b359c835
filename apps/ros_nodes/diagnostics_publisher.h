#pragma once
// How a program is, on /diagnostics.

#include <ros/ros.h>
#include <nlohmann/json_fwd.hpp>

#include <functional>
#include <string>

namespace mapweave::ros_nodes {

// Publishes diagnostics_message() of what `status` returns, once a second of wall time, from the node's callback queue:
// `status` must be quick (runtime::program_status() is). Where it throws, the program is STALE.
class DiagnosticsPublisher {
 public:
  using Status = std::function<nlohmann::ordered_json()>;
  DiagnosticsPublisher(ros::NodeHandle node, Status status);

 private:
  void publish();

  Status status_;
  std::string problem_;  // that was logged last
  ros::Publisher publisher_;
  ros::WallTimer timer_;  // the last member: it ends before what it uses
};

}  // namespace mapweave::ros_nodes
