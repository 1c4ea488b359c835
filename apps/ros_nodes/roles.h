#pragma once
// What nodes of ROS add to the roles of a deployment.

#include "diagnostics_publisher.h"
#include "requests_server.h"
#include "tier_topics.h"
#include "topic_recorder.h"

#include <serve.h>

#include <memory>
#include <optional>
#include <string>

namespace mapweave::ros_nodes {

// What all have: the node, and its diagnostics.
class NodeRole : public app::RoleExtension {
 public:
  std::unique_ptr<runtime::Wires> wires(const app::Deployment& deployment,
                                        const std::optional<TierId>& edge) const override;
  void begin(const app::Deployment& deployment, const std::string& name, app::StopSignals& stops) override;
  void leave_tier() override;

 protected:
  const app::Deployment& deployment() const { return *deployment_; }
  const std::string& name() const { return name_; }
  RosNode& node() { return *node_; }
  void turn(const Status& status);

 private:
  const app::Deployment* deployment_ = nullptr;
  std::string name_;
  std::optional<RosNode> node_;
  std::optional<DiagnosticsPublisher> diagnostics_;
};

// Records the robot's topics into its log. ROBOT/finish (std_srvs/Trigger) ends the drive.
class RobotNode : public NodeRole {
 public:
  using NodeRole::look;
  void begin(const app::Deployment& deployment, const std::string& name, app::StopSignals& stops) override;
  bool look(const app::StartingRobot&, const Status&) override;
  bool has_log() const override { return recorder_ && recorder_->is_recording(); }
  void end_log() override;
  void leave_log() override;

 private:
  std::optional<TopicRecorder> recorder_;
  std::optional<EndService> end_;
};

class EdgeNode : public NodeRole {
 public:
  using NodeRole::look;
  bool look(runtime::LiveEdge& edge, const Status& status) override;
  void leave_tier() override;
  bool shows_maps() const override { return true; }

 private:
  std::optional<RequestsReader> requests_;
  std::optional<TierTopics> topics_;
};

// cloud/finish (std_srvs/Trigger) merges what is there.
class CloudNode : public NodeRole {
 public:
  using NodeRole::look;
  bool look(runtime::LiveCloud& cloud, const Status& status) override;
  void leave_tier() override;
  bool shows_maps() const override { return true; }

 private:
  std::optional<RequestsServer> requests_;
  std::optional<TierTopics> topics_;
  std::optional<EndService> end_;
};

// coordinator/replan (std_srvs/Trigger) decides at once; coordinator/plan (std_msgs/String, latched) is the plan, sent
// again where it was asked for.
class CoordinatorNode : public NodeRole {
 public:
  using NodeRole::look;
  bool look(runtime::LiveCoordinator& coordinator, const Status& status) override;

 private:
  bool replan(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  std::atomic<bool> is_asked_{false};
  bool has_decided_ = false;  // since somebody asked
  std::uint64_t published_ = 0;
  ros::Publisher plan_;
};

}  // namespace mapweave::ros_nodes
