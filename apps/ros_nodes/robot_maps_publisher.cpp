#include "robot_maps_publisher.h"

#include "odometry_track.h"
#include "on_demand_topic.h"
#include "robot_map.h"
#include "ros_messages.h"
#include "topic_problems.h"
#include "transform_sender.h"

#include <mapweave/fusion/growing_grid.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <set>

namespace mapweave::ros_nodes {
namespace {

constexpr double kKeptTransforms_s = 600.0;  // as long as the odometry of a topic

// One robot's topics, and how its odometry lies in its map.
class RobotPublisher {
 public:
  RobotPublisher(ros::NodeHandle node, const std::string& name, PublishedRobot robot,
                 const fusion::ComposeOptions& grid)
      : name_(name), robot_(std::move(robot)), drawn_(grid), grid_(node, name + "/map"), path_(node, name + "/path") {
    if (robot_.odometry_frame.empty()) robot_.odometry_frame = name + "/odom";
    if (robot_.robot_frame.empty()) robot_.robot_frame = name + "/base_link";
    if (!robot_.odometry_topic.empty())
      subscriber_ = node.subscribe<nav_msgs::Odometry>(
          robot_.odometry_topic, 100, [this](const nav_msgs::Odometry::ConstPtr& message) { track_.add(*message); });
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

  std::optional<OdometryCorrection::Result> correction(const tf2_ros::Buffer& transforms) {
    if (!map_) return std::nullopt;
    return correction_.update(map_->trajectory, [&](Stamp stamp) { return odometry_at(stamp, transforms); });
  }

 private:
  // Another program publishes it now.
  void forget() {
    map_.reset();
    grid_.forget();
    path_.forget();
  }

  std::optional<OdometryPose> odometry_at(Stamp stamp, const tf2_ros::Buffer& transforms) const {
    if (auto pose = track_.at(stamp)) return pose;
    OdometryPose asked{without_slash(robot_.odometry_frame), without_slash(robot_.robot_frame), {}};
    if (const auto known = track_.frames(); known && !known->robot_frame.empty()) asked = *known;
    try {
      const auto found = pose_of(transforms.lookupTransform(asked.frame, asked.robot_frame, ros_time(stamp)).transform);
      if (!found) return std::nullopt;
      asked.odometry_from_robot = *found;
      return asked;
    } catch (const tf2::TransformException&) {  // not known, or not for that time
      return std::nullopt;
    } catch (const Error&) {  // no time of ROS
      return std::nullopt;
    }
  }

  const std::string name_;
  PublishedRobot robot_;
  std::shared_ptr<const Map> taken_;
  std::optional<RobotMap> map_;
  std::uint64_t version_ = 0;  // of what map_ looks like
  OdometryCorrection correction_;
  OdometryTrack track_;
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
      const auto correction = robot->correction(transforms_);
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
