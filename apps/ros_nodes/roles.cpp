#include "roles.h"

#include "ros_names.h"
#include "ros_wires.h"

#include <mapweave/core/error.h>
#include <nlohmann/json.hpp>

#include <algorithm>

namespace mapweave::ros_nodes {
namespace {

const runtime::PlannedRobot& planned(const app::Deployment& deployment, const std::string& name) {
  return *std::find_if(deployment.plan.robots.begin(), deployment.plan.robots.end(),
                       [&](const runtime::PlannedRobot& robot) { return robot.id.str() == name; });
}

std::string ros_name_of(const std::string& id) { return RosNames({id}).of(id); }

std::filesystem::path requests_file(const app::Deployment& deployment) {
  return std::filesystem::path(deployment.live().store) / "requests.json";
}

}  // namespace

std::unique_ptr<runtime::Wires> NodeRole::wires(const app::Deployment& deployment,
                                                const std::optional<TierId>& edge) const {
  if (!deployment.live().is_over_ros()) return RoleExtension::wires(deployment, edge);
  return std::make_unique<RosWires>(deployment.loaded.configuration, deployment.plan);
}

void NodeRole::begin(const app::Deployment& deployment, const std::string& name, app::StopSignals& stops) {
  deployment_ = &deployment;
  name_ = name;
  node_.emplace(stops);
}

void NodeRole::leave_tier() {
  node_->stop();
  diagnostics_.reset();
}

void NodeRole::turn(const Status& status) {
  if (!diagnostics_) diagnostics_.emplace(node_->handle(), status);
  node_->keep();
}

void RobotNode::begin(const app::Deployment& deployment, const std::string& name, app::StopSignals& stops) {
  NodeRole::begin(deployment, name, stops);
  recorder_.emplace(node().handle(), planned(deployment, name), deployment.loaded.configuration);
  end_.emplace(node(), ros_name_of(name) + "/finish", "robot " + name + " ends its drive");
}

bool RobotNode::look(const app::StartingRobot&, const Status& status) {
  turn(status);
  recorder_->look();
  return end_->is_asked();
}

void RobotNode::end_log() {
  if (recorder_) recorder_->finish();
}

void RobotNode::leave_log() {
  if (recorder_) recorder_->leave();
}

bool EdgeNode::look(runtime::LiveEdge& edge, const Status& status) {
  turn(status);
  if (topics_) return false;
  requests_.emplace(node(), deployment().plan,
                    [&edge](const runtime::LiveRequests& requests) { return edge.follow(requests); });
  TierOfTeam tier{name(), {}, false};
  // A coordinator may give it any robot.
  for (const runtime::PlannedRobot& robot : deployment().plan.robots)
    if (robot.edge.str() == name() || robot.edge.empty()) tier.robots.push_back(robot.id);
  topics_.emplace(node(), deployment().loaded.configuration, deployment().plan, tier,
                  TierTopics::Maps{[&edge] { return edge.preview(); },
                                   [&edge](const RobotId& robot) { return edge.map_so_far(robot); }});
  return false;
}

void EdgeNode::leave_tier() {
  NodeRole::leave_tier();
  topics_.reset();
  requests_.reset();
}

bool CloudNode::look(runtime::LiveCloud& cloud, const Status& status) {
  turn(status);
  if (!topics_) {
    const auto preview = [&cloud] { return cloud.preview(); };
    requests_.emplace(node(), RequestsServer::Team{deployment().loaded.configuration, deployment().plan},
                      requests_file(deployment()), preview,
                      [&cloud](const runtime::LiveRequests& requests) { return cloud.follow(requests); });
    end_.emplace(node(), "cloud/finish", "the cloud merges what is there");
    topics_.emplace(node(), deployment().loaded.configuration, deployment().plan, TierOfTeam{name(), {}, true},
                    TierTopics::Maps{preview, {}});
  }
  return end_->is_asked();
}

void CloudNode::leave_tier() {
  NodeRole::leave_tier();
  topics_.reset();
  requests_.reset();
}

bool CoordinatorNode::look(runtime::LiveCoordinator& coordinator, const Status& status) {
  turn(status);
  if (!plan_) {
    node().serve("coordinator/replan", &CoordinatorNode::replan, this);
    plan_ = node().handle().advertise<std_msgs::String>("coordinator/plan", 1, true);
  }
  const runtime::LivePlan plan = coordinator.plan();
  if (plan.number != published_ || has_decided_) {
    std_msgs::String message;
    message.data = encode(plan);
    plan_.publish(message);
    published_ = plan.number;
  }
  return has_decided_ = is_asked_.exchange(false);  // once this has returned, the coordinator decides
}

bool CoordinatorNode::replan(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  is_asked_ = true;
  response.success = 1;
  response.message = "the coordinator decides now; its plan comes on coordinator/plan, also where it stays as it is";
  return true;
}

}  // namespace mapweave::ros_nodes
