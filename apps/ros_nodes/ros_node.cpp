#include "ros_node.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>

namespace mapweave::ros_nodes {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// By which programs of mapweave know each other.
constexpr char kMark[] = "is_mapweave";

void wait_for_master(app::StopSignals& stops) {
  constexpr auto kPatience = 15s;
  auto next = Clock::now() + 1s;
  while (!ros::master::check()) {
    if (Clock::now() >= next) {
      log(LogLevel::warning, "no ROS master answers at " + ros::master::getURI() +
                                 "; it is waited for. Start roscore, or set ROS_MASTER_URI");
      next = Clock::now() + kPatience;
    }
    if (stops.wait(200ms)) throw Interrupted("interrupted while it waited for the ROS master");
  }
}

}  // namespace

bool is_node_of_mapweave(const std::string& node) {
  bool is_ours = false;
  ros::param::get(node + "/" + kMark, is_ours);
  return is_ours;
}

RosNode::RosNode(app::StopSignals& stops) {
  wait_for_master(stops);
  handle_.emplace();
  ros::param::set(ros::this_node::getName() + "/" + kMark, true);
  spinner_.emplace(1);
  spinner_->start();
}

RosNode::~RosNode() {
  spinner_->stop();
  ros::param::del(ros::this_node::getName() + "/" + kMark);
}

bool RosNode::is_forgotten() {
  if (Clock::now() < next_) return false;
  next_ = Clock::now() + 1s;
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = request[1] = ros::this_node::getName();
  if (!ros::master::check() || ros::master::execute("lookupNode", request, response, payload, false)) return false;
  log(LogLevel::warning, "the ROS master was started again; this node registers anew");
  ros::param::set(ros::this_node::getName() + "/" + kMark, true);
  return true;
}

}  // namespace mapweave::ros_nodes
