#include "robot_maps_publisher.h"

#include "odometry_track.h"
#include "on_demand_topic.h"
#include "robot_map.h"
#include "ros_messages.h"
#include "topic_problems.h"
#include "transform_sender.h"

#include <mapweave/fusion/growing_grid.h>
#include <mapweave/rawlog/ros_recorder.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <algorithm>
#include <chrono>
#include <set>

namespace mapweave::ros_nodes {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr double kKeptTransforms_s = 600.0;  // as long as the odometry of a topic
constexpr auto kBetweenLooks = 2s, kPatience = 15s;

// One robot's topics, and how its odometry lies in its map.
class RobotPublisher {
 public:
  RobotPublisher(ros::NodeHandle node, const std::string& name, PublishedRobot robot,
                 const fusion::ComposeOptions& grid)
      : node_(node),
        name_(name),
        robot_(std::move(robot)),
        drawn_(grid),
        grid_(node, name + "/map"),
        path_(node, name + "/path") {
    look_for_odometry();
  }
  RobotPublisher(const RobotPublisher&) = delete;

  const RobotId& robot() const { return robot_.robot; }
  std::string frame() const { return name_ + "/map"; }

  void take(const std::shared_ptr<const Map>& map) {
    if (map == taken_) return;
    taken_ = map;
    auto now = map ? robot_map(*map, robot_.robot) : std::nullopt;
    if (!now) return forget();
    if (!map_ || !looks_the_same(map_->map, now->map)) ++version_;
    map_ = std::move(now);
  }

  void show_path(Problems& problems) {
    if (!map_) return;
    path_.show(version_, [&] {
      return problems.guarded("no " + name_ + "/path", [&] { return path_message(map_->trajectory, frame()); });
    });
  }

  void show_grid(WorkerPool& pool, Problems& problems) {
    if (!map_) return;
    grid_.show(version_, [&]() -> std::optional<nav_msgs::OccupancyGrid> {
      return problems
          .guarded("no " + name_ + "/map",
                   [&]() -> std::optional<nav_msgs::OccupancyGrid> {
                     const OccupancyGrid& drawn = drawn_.draw(map_->map, pool);
                     if (drawn.empty()) return std::nullopt;  // viewers take it for an error
                     return grid_message(drawn, frame());
                   })
          .value_or(std::nullopt);
    });
  }

  std::optional<OdometryCorrection::Result> correction(const tf2_ros::Buffer& transforms, Problems& problems) {
    look_for_odometry();
    if (!map_) return std::nullopt;
    auto result = correction_.update(map_->trajectory, [&](Stamp stamp) { return odometry_at(stamp, transforms); });
    if (result || !missing_since_) missing_since_ = Clock::now();
    if (!result && Clock::now() - *missing_since_ > kPatience)
      problems.say("no transform " + frame() + " -> odometry of " + name_,
                   subscriber_
                       ? subscriber_.getTopic() + " says nothing of the time of the robot's newest pose"
                       : "the robot has no topic of nav_msgs/Odometry, and /tf no frame of odometry above " +
                             (robot_.robot_frame.empty() ? robot_.frame_prefix + "base_link" : robot_.robot_frame));
    return result;
  }

 private:
  // Another program publishes it now.
  void forget() {
    map_.reset();
    grid_.forget();
    path_.forget();
  }

  void look_for_odometry() {
    if (subscriber_ || !robot_.odometry_topic || Clock::now() < next_look_) return;
    next_look_ = Clock::now() + kBetweenLooks;
    if (const auto topic = robot_.odometry_topic())
      subscriber_ = node_.subscribe<nav_msgs::Odometry>(
          *topic, 100, [this](const nav_msgs::Odometry::ConstPtr& message) { track_.add(*message); });
  }

  // The names of its frames in tf.
  std::optional<OdometryPose> frames_in(const tf2_ros::Buffer& transforms) const {
    std::vector<std::string> frames;
    transforms._getFrameStrings(frames);
    std::sort(frames.begin(), frames.end());
    const std::string& prefix = robot_.frame_prefix;
    for (const std::string& frame : frames) {
      std::string parent;
      if (!transforms._getParent(frame, ros::Time(0), parent) || !rawlog::is_odometry_frame(parent)) continue;
      if (frame.compare(0, prefix.size(), prefix) != 0 && parent.compare(0, prefix.size(), prefix) != 0) continue;
      return OdometryPose{parent, robot_.robot_frame.empty() ? frame : without_slash(robot_.robot_frame), {}};
    }
    return std::nullopt;
  }

  std::optional<OdometryPose> odometry_at(Stamp stamp, const tf2_ros::Buffer& transforms) const {
    if (auto pose = track_.at(stamp)) return pose;
    auto asked = track_.frames();
    if (!asked || asked->robot_frame.empty()) asked = frames_in(transforms);
    if (!asked) return std::nullopt;
    try {
      const auto found =
          pose_of(transforms.lookupTransform(asked->frame, asked->robot_frame, ros_time(stamp)).transform);
      if (!found) return std::nullopt;
      asked->odometry_from_robot = *found;
      return asked;
    } catch (const tf2::TransformException&) {  // not known, or not for that time
      return std::nullopt;
    } catch (const Error&) {  // no time of ROS
      return std::nullopt;
    }
  }

  ros::NodeHandle node_;
  const std::string name_;
  const PublishedRobot robot_;
  std::shared_ptr<const Map> taken_;
  std::optional<RobotMap> map_;
  std::uint64_t version_ = 0;  // of what map_ looks like
  OdometryCorrection correction_;
  OdometryTrack track_;
  Clock::time_point next_look_{};
  std::optional<Clock::time_point> missing_since_;  // its odometry, while it has a map
  fusion::GrowingGrid drawn_;
  GridTopic grid_;
  OnDemandTopic<nav_msgs::Path> path_;
  ros::Subscriber subscriber_;  // the last member: its callback ends before what it uses
};

}  // namespace

class RobotMapsPublisher::State {
 public:
  State(ros::NodeHandle node, const RosNames& names, const RobotMapsOptions& options, MapOf map_of, WorkerPool& pool)
      : map_of_(std::move(map_of)), pool_(pool), sender_(node, options.transforms_hz) {
    for (const PublishedRobot& robot : options.robots)
      robots_.push_back(std::make_unique<RobotPublisher>(node, names.of(robot.robot.str()), robot, options.grid));
    if (!robots_.empty()) listener_.emplace(transforms_, node);
  }

  void publish() {
    for (const auto& robot : robots_) {
      robot->take(map_of_(robot->robot()));
      robot->show_path(problems_);
    }
    sender_.set(transforms());
    for (const auto& robot : robots_) robot->show_grid(pool_, problems_);
  }

 private:
  std::vector<geometry_msgs::TransformStamped> transforms() {
    std::vector<geometry_msgs::TransformStamped> transforms;
    std::set<std::string> odometry_frames;
    for (const auto& robot : robots_) {
      const auto correction = robot->correction(transforms_, problems_);
      if (!correction) continue;
      if (odometry_frames.insert(correction->odometry_frame).second)
        transforms.push_back(
            transform_between(robot->frame(), correction->odometry_frame, correction->map_from_odometry));
      else
        problems_.say("no transform " + robot->frame() + " -> " + correction->odometry_frame,
                      "another robot's odometry frame has this name; give each robot's a name of its own");
    }
    return transforms;
  }

  const MapOf map_of_;
  WorkerPool& pool_;
  Problems problems_;
  tf2_ros::Buffer transforms_{ros::Duration(kKeptTransforms_s), false};
  std::vector<std::unique_ptr<RobotPublisher>> robots_;
  TransformSender sender_;
  std::optional<tf2_ros::TransformListener> listener_;
};

RobotMapsPublisher::RobotMapsPublisher(ros::NodeHandle node, RosNames names, RobotMapsOptions options, MapOf map_of,
                                       WorkerPool& pool)
    : state_(std::make_unique<State>(std::move(node), names, options, std::move(map_of), pool)) {}

RobotMapsPublisher::~RobotMapsPublisher() = default;

void RobotMapsPublisher::publish() { state_->publish(); }

}  // namespace mapweave::ros_nodes
