#pragma once
// Services and topics by which users ask for something while a team maps.

#include "initial_pose.h"
#include "ros_node.h"

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/live_preview.h>
#include <mapweave/runtime/live_requests.h>
#include <mapweave_msgs/SetInitialPose.h>
#include <mapweave_msgs/UndoJoin.h>
#include <rosgraph_msgs/Log.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace mapweave::ros_nodes {

// A service std_srvs/Trigger that is asked for an end. The caller looks, now and then.
class EndService {
 public:
  EndService(RosNode& node, const std::string& name, std::string what_ends);
  EndService(const EndService&) = delete;
  EndService& operator=(const EndService&) = delete;
  bool is_asked() const { return is_asked_; }

 private:
  bool end(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  const std::string what_ends_;
  std::atomic<bool> is_asked_{false};
};

// undo_join (mapweave_msgs/UndoJoin) below the tier's name: two robots' maps are never matched to each other from then
// on. ROBOT/initialpose (geometry_msgs/PoseWithCovarianceStamped, in the team frame): where the robot is now;
// initialpose, which RViz publishes: of the one robot whose map is not in the largest one; set_initial_pose
// (mapweave_msgs/SetInitialPose): either, with an answer. What comes of a request is said on /rosout too. Kept in a
// file, so that a program that is started again knows them, and published as they are (CLOUD/requests, latched JSON),
// for edges that are other programs.
class RequestsServer {
 public:
  using Preview = std::function<std::shared_ptr<const runtime::LivePreview>()>;
  // False: it is too late.
  using Follow = std::function<bool(const runtime::LiveRequests&)>;
  struct Team {
    const runtime::RunConfiguration& configuration;
    const runtime::RunPlan& plan;
  };
  RequestsServer(RosNode& node, const Team& team, std::filesystem::path file, Preview preview, Follow follow);

 private:
  bool undo_join(mapweave_msgs::UndoJoin::Request& request, mapweave_msgs::UndoJoin::Response& response);
  bool set_initial_pose(mapweave_msgs::SetInitialPose::Request& request,
                        mapweave_msgs::SetInitialPose::Response& response);
  using Pose = geometry_msgs::PoseWithCovarianceStamped;
  void take_pose(const RobotId& robot, const Pose& pose);
  void take_pose_of_apart(const Pose& pose);
  struct Answer {
    bool is_taken = false;
    std::string text;
  };
  Answer take(const RobotId& robot, const std::function<GivenPose()>& given);
  RobotId robot_apart() const;
  void apply(runtime::LiveRequests requests);
  void answer(LogLevel level, const std::string& text);

  const Team team_;
  const std::filesystem::path file_;
  const Preview preview_;
  const Follow follow_;
  std::mutex mutex_;
  runtime::LiveRequests requests_;
  std::vector<ros::Subscriber> poses_;
  ros::Publisher publisher_, answers_;
};

// Follows what a RequestsServer of another program publishes. Calls come on the node's thread.
class RequestsReader {
 public:
  RequestsReader(RosNode& node, const runtime::RunPlan& plan, RequestsServer::Follow follow);

 private:
  void take(const std_msgs::String& message);
  const runtime::RunPlan& plan_;
  const RequestsServer::Follow follow_;
  ros::Subscriber subscriber_;
};

}  // namespace mapweave::ros_nodes
