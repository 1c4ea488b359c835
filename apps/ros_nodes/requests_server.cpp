#include "requests_server.h"

#include "ros_messages.h"
#include "ros_names.h"

#include <mapweave/core/files.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapweave::ros_nodes {
namespace {

constexpr char kRequests[] = "cloud/requests";
constexpr std::uint32_t kQueue = 10;

std::string joined_names(const std::vector<RobotId>& robots, const std::string& between) {
  std::string names;
  for (const RobotId& robot : robots) names += (names.empty() ? "" : between) + robot.str();
  return names;
}

// With standard deviations where they are given.
GivenPose given_pose(const RobotId& robot, const Pose2& pose, double sigma_m, double sigma_rad) {
  constexpr double kMost_m = 100.0, kMost_rad = 3.0;
  GivenPose given{robot, pose};
  if (sigma_m > 0.0) given.sigma_m = std::min(sigma_m, kMost_m);
  if (sigma_rad > 0.0) given.sigma_rad = std::min(sigma_rad, kMost_rad);
  return given;
}

void expect_robot(const runtime::RunPlan& plan, const std::string& name) {
  if (std::none_of(plan.robots.begin(), plan.robots.end(),
                   [&](const runtime::PlannedRobot& robot) { return robot.id.str() == name; }))
    throw Error(ErrorCode::kBadInput, "there is no robot '" + name + "'", {}, "name a robot of the team");
}

[[noreturn]] void throw_no_pose() {
  throw Error(ErrorCode::kBadInput, "is no pose", {}, "give finite numbers and a rotation");
}

GivenPose given_pose(const RobotId& robot, const geometry_msgs::PoseWithCovarianceStamped& pose) {
  constexpr std::size_t kXX = 0, kYY = 7, kYawYaw = 35;
  const auto where = pose_of(pose.pose.pose);
  if (!where) throw_no_pose();
  const std::string frame = pose.header.frame_id;
  if (!frame.empty() && frame != "team" && frame != "/team")
    throw Error(ErrorCode::kBadInput, "is in frame '" + frame + "'", {}, "give it in frame 'team'");
  const auto& covariance = pose.pose.covariance;
  return given_pose(robot, planar(*where), std::sqrt(std::max(covariance[kXX], covariance[kYY])),
                    std::sqrt(covariance[kYawYaw]));
}

}  // namespace

EndService::EndService(RosNode& node, const std::string& name, std::string what_ends)
    : what_ends_(std::move(what_ends)) {
  node.serve(name, &EndService::end, this);
}

bool EndService::end(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  is_asked_ = true;
  response.success = 1;
  response.message = what_ends_;
  return true;
}

RequestsServer::RequestsServer(RosNode& node, const Team& team, std::filesystem::path file, Preview preview,
                               Follow follow)
    : team_(team), file_(std::move(file)), preview_(std::move(preview)), follow_(std::move(follow)) {
  std::error_code ignored;
  if (std::filesystem::exists(file_, ignored)) {
    requests_ = runtime::decode_live_requests(read_file(file_), team_.plan, file_.string());
    follow_(requests_);
  }
  publisher_ = node.handle().advertise<std_msgs::String>(kRequests, 1, true);
  answers_ = node.handle().advertise<rosgraph_msgs::Log>("/rosout", kQueue);
  for (const runtime::PlannedRobot& robot : team_.plan.robots) {
    const std::string name = RosNames({robot.id.str()}).of(robot.id.str());
    poses_.push_back(node.handle().subscribe<Pose>(
        name + "/initialpose", kQueue, [this, id = robot.id](const Pose::ConstPtr& pose) { take_pose(id, *pose); }));
  }
  poses_.push_back(node.handle().subscribe<Pose>("initialpose", kQueue,
                                                 [this](const Pose::ConstPtr& pose) { take_pose_of_apart(*pose); }));
  std_msgs::String message;
  message.data = encode(requests_);
  publisher_.publish(message);
  node.serve("cloud/undo_join", &RequestsServer::undo_join, this);
  node.serve("cloud/set_initial_pose", &RequestsServer::set_initial_pose, this);
}

// Under mutex_. Throws where it is too late.
void RequestsServer::apply(runtime::LiveRequests requests) {
  if (!follow_(requests))
    throw Error(ErrorCode::kBadInput, "the final map is being made already", {},
                "merge again without it: mapweave merge DIR --refuse A,B, or --anchor");
  requests_ = std::move(requests);
  write_file(file_, encode(requests_) + "\n");
  std_msgs::String message;
  message.data = encode(requests_);
  publisher_.publish(message);
}

bool RequestsServer::undo_join(mapweave_msgs::UndoJoin::Request& request, mapweave_msgs::UndoJoin::Response& response) {
  const std::lock_guard lock(mutex_);
  try {
    for (const std::string& name : {request.a, request.b}) expect_robot(team_.plan, name);
    if (request.a == request.b) throw Error(ErrorCode::kBadInput, "they are one robot", {}, "name two robots");
    runtime::LiveRequests requests = requests_;
    requests.refused.insert(std::minmax(RobotId(request.a), RobotId(request.b)));
    apply(std::move(requests));
    response.success = 1;
    response.message = "the maps of " + request.a + " and " + request.b + " are not matched to each other any more";
  } catch (const Error& error) {
    response.success = 0;
    response.message = error.what();
  }
  answer(LogLevel::info, "undo_join: " + response.message);
  return true;
}

RequestsServer::Answer RequestsServer::take(const RobotId& robot, const std::function<GivenPose()>& given) {
  const std::lock_guard lock(mutex_);
  Answer result;
  try {
    const auto preview = preview_();
    runtime::LiveRequests requests = requests_;
    add_pose(given(), preview != nullptr ? *preview : runtime::LivePreview(), team_.configuration, requests);
    apply(std::move(requests));
    result = {true, "robot " + robot.str() + ": its pose in the team's map was given, and counts from now on"};
  } catch (const Error& error) {
    result.text = "the pose given of robot " + robot.str() + " is left out: " + error.what();
  }
  answer(result.is_taken ? LogLevel::info : LogLevel::warning, result.text);
  return result;
}

void RequestsServer::take_pose(const RobotId& robot, const Pose& pose) {
  take(robot, [&] { return given_pose(robot, pose); });
}

// Throws Error where it is not one.
RobotId RequestsServer::robot_apart() const {
  const auto preview = preview_();
  std::vector<RobotId> apart;
  if (preview != nullptr)
    for (std::size_t i = 1; i < preview->parts.size(); ++i) {
      const std::vector<RobotId> robots = preview->parts[i].map.robots();
      apart.insert(apart.end(), robots.begin(), robots.end());
    }
  if (apart.size() == 1) return apart.front();
  if (preview == nullptr || preview->parts.empty()) throw Error(ErrorCode::kBadInput, "there is no map yet");
  if (apart.empty())
    throw Error(ErrorCode::kBadInput, "all robots that have a map are in the largest one", {},
                "publish it on ROBOT/initialpose, or name the robot in cloud/set_initial_pose");
  throw Error(ErrorCode::kBadInput,
              "it may be of " + joined_names(apart, " or ") + ", which are apart from the largest map", {},
              "publish it on " + RosNames({apart.front().str()}).of(apart.front().str()) +
                  "/initialpose or its like, or name the robot in cloud/set_initial_pose");
}

void RequestsServer::take_pose_of_apart(const Pose& pose) {
  try {
    take_pose(robot_apart(), pose);
  } catch (const Error& error) {
    answer(LogLevel::warning, std::string("a pose on initialpose is left out: ") + error.what());
  }
}

bool RequestsServer::set_initial_pose(mapweave_msgs::SetInitialPose::Request& request,
                                      mapweave_msgs::SetInitialPose::Response& response) {
  try {
    if (!request.robot.empty()) expect_robot(team_.plan, request.robot);
    const RobotId robot = request.robot.empty() ? robot_apart() : RobotId(request.robot);
    const Answer result = take(robot, [&] {
      for (const double number : {request.x, request.y, request.yaw, request.sigma_xy, request.sigma_yaw})
        if (!std::isfinite(number)) throw_no_pose();
      return given_pose(robot, {request.x, request.y, request.yaw}, request.sigma_xy, request.sigma_yaw);
    });
    response.success = result.is_taken ? 1 : 0;
    response.message = result.text;
  } catch (const Error& error) {
    response.success = 0;
    response.message = error.what();
  }
  return true;
}

// On the console, and for who listens to ROS alone.
void RequestsServer::answer(LogLevel level, const std::string& text) {
  log(level, text);
  rosgraph_msgs::Log message;
  message.header.stamp = ros::Time::now();
  message.level = level == LogLevel::warning ? rosgraph_msgs::Log::WARN : rosgraph_msgs::Log::INFO;
  message.name = ros::this_node::getName();
  message.msg = text;
  answers_.publish(message);
}

RequestsReader::RequestsReader(RosNode& node, const runtime::RunPlan& plan, RequestsServer::Follow follow)
    : plan_(plan), follow_(std::move(follow)) {
  subscriber_ = node.handle().subscribe<std_msgs::String>(
      kRequests, kQueue, [this](const std_msgs::String::ConstPtr& message) { take(*message); });
}

void RequestsReader::take(const std_msgs::String& message) {
  try {
    if (!follow_(runtime::decode_live_requests(message.data, plan_, kRequests)))
      log(LogLevel::warning, "a request came too late: this edge has merged its maps");
  } catch (const Error& error) {
    log(LogLevel::warning, std::string("a request is left out: ") + error.what());
  }
}

}  // namespace mapweave::ros_nodes
