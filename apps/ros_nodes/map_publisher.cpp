#include "map_publisher.h"

#include "odometry_track.h"
#include "on_demand_topic.h"
#include "robot_map.h"
#include "ros_messages.h"
#include "transform_sender.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <map>
#include <set>

namespace mapweave::ros_nodes {
namespace {

constexpr double kKeptTransforms_s = 600.0;  // as long as the odometry of a topic

// What is logged once, until another problem comes.
class Problems {
 public:
  template <class Make>
  auto guarded(const std::string& what, Make&& make) -> std::optional<decltype(make())> {
    try {
      return make();
    } catch (const Error& error) {
      say(what, error.what());
      return std::nullopt;
    }
  }
  void say(const std::string& what, const std::string& why) {
    if (std::exchange(said_[what], why) != why) log(LogLevel::warning, what + ": " + why);
  }

 private:
  std::map<std::string, std::string> said_;
};

geometry_msgs::TransformStamped transform_of(const std::string& parent, const std::string& child,
                                             const Pose3& parent_from_child) {
  geometry_msgs::TransformStamped message;
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform = transform_message(parent_from_child);
  return message;
}

// Grids as messages; nullopt for one without cells, which viewers take for an error.
class GridMaker {
 public:
  GridMaker(const fusion::ComposeOptions& options, WorkerPool& pool, Problems& problems)
      : options_(options), pool_(pool), problems_(problems) {}
  std::optional<nav_msgs::OccupancyGrid> operator()(const Map& map, const std::string& topic,
                                                    const std::string& frame) const {
    const auto grid = problems_.guarded("no " + topic, [&] { return fusion::compose_grid(map, options_, pool_); });
    if (!grid || grid->empty()) return std::nullopt;
    return grid_message(*grid, frame);
  }

 private:
  const fusion::ComposeOptions& options_;
  WorkerPool& pool_;
  Problems& problems_;
};

// One robot's topics, and how its odometry lies in its map.
class RobotPublisher {
 public:
  RobotPublisher(ros::NodeHandle node, const std::string& name, PublishedRobot robot)
      : name_(name), robot_(std::move(robot)), grid_(node, name + "/map"), path_(node, name + "/path") {
    if (robot_.odometry_frame.empty()) robot_.odometry_frame = name + "/odom";
    if (robot_.robot_frame.empty()) robot_.robot_frame = name + "/base_link";
    if (!robot_.odometry_topic.empty())
      subscriber_ = node.subscribe<nav_msgs::Odometry>(
          robot_.odometry_topic, 100, [this](const nav_msgs::Odometry::ConstPtr& message) { track_.add(*message); });
  }
  RobotPublisher(const RobotPublisher&) = delete;

  std::string frame() const { return name_ + "/map"; }

  void take(const runtime::LivePreview& preview) {
    auto now = robot_map(preview, robot_.robot);
    if (!now) return;
    if (!map_ || !looks_the_same(map_->map, now->map)) ++version_;
    map_ = std::move(now);
  }

  void show(const GridMaker& make_grid, Problems& problems) {
    if (!map_) return;
    grid_.show(version_, [&] { return make_grid(map_->map, name_ + "/map", frame()); });
    path_.show(version_, [&] {
      return problems.guarded("no " + name_ + "/path", [&] { return path_message(map_->trajectory, frame()); });
    });
  }

  std::optional<OdometryCorrection::Result> correction(const tf2_ros::Buffer& transforms) {
    if (!map_) return std::nullopt;
    return correction_.update(map_->trajectory, [&](Stamp stamp) { return odometry_at(stamp, transforms); });
  }

 private:
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
  std::optional<RobotMap> map_;
  std::uint64_t version_ = 0;  // of what map_ looks like
  OdometryCorrection correction_;
  OdometryTrack track_;
  GridTopic grid_;
  OnDemandTopic<nav_msgs::Path> path_;
  ros::Subscriber subscriber_;  // the last member: its callback ends before what it uses
};

}  // namespace

class MapPublisher::State {
 public:
  State(ros::NodeHandle node, RosNames names, MapPublisherOptions options, WorkerPool& pool)
      : names_(std::move(names)),
        options_(std::move(options)),
        make_grid_(options_.grid, pool, problems_),
        prefix_(names_.of(options_.tier)),
        grid_(node, prefix_ + "/map"),
        cloud_(node, prefix_ + "/cloud"),
        graph_(node, prefix_ + "/graph"),
        sender_(node, options_.transforms_hz) {
    for (const PublishedRobot& robot : options_.robots)
      if (names_.of(robot.robot.str()) == prefix_)
        throw Error(ErrorCode::kBadInput, "a robot and its tier are both called '" + prefix_ + "' in topics of ROS",
                    options_.tier, "give one of them another name");
    for (const PublishedRobot& robot : options_.robots)
      robots_.push_back(std::make_unique<RobotPublisher>(node, names_.of(robot.robot.str()), robot));
    if (!robots_.empty()) listener_.emplace(transforms_, node);
  }

  void publish(const std::shared_ptr<const runtime::LivePreview>& preview) {
    if (preview == nullptr) return;
    if (preview != preview_) take(preview);
    sender_.set(transforms());
    for (const auto& robot : robots_) robot->show(make_grid_, problems_);
    if (preview_->parts.empty()) return;
    const Map& map = preview_->parts.front().map;
    grid_.show(looks_, [&] { return make_grid_(map, prefix_ + "/map", options_.team_frame); });
    cloud_.show(looks_, [&] {
      return std::optional(cloud_message(exporters::map_cloud(map, options_.cloud), options_.team_frame));
    });
    graph_.show(version_, [&] { return std::optional(graph_message(map, options_.team_frame)); });
  }

 private:
  void take(const std::shared_ptr<const runtime::LivePreview>& preview) {
    const bool is_known = preview_ != nullptr && !preview_->parts.empty() && !preview->parts.empty() &&
                          looks_the_same(preview_->parts.front().map, preview->parts.front().map);
    if (!is_known) ++looks_;
    ++version_;
    preview_ = preview;
    for (const auto& robot : robots_) robot->take(*preview);
    team_ = team_transforms();
  }

  std::vector<geometry_msgs::TransformStamped> team_transforms() const {
    std::vector<geometry_msgs::TransformStamped> transforms;
    if (options_.team_transforms == TeamTransforms::none || preview_->parts.empty()) return transforms;
    for (const RobotId& robot : preview_->parts.front().map.robots()) {
      const auto own = robot_map(*preview_, robot);
      if (!own || own->part != 0) continue;
      const std::string frame = names_.of(robot.str()) + "/map";
      if (options_.team_transforms == TeamTransforms::below)
        return {transform_of(frame, options_.team_frame, inverse(own->part_from_robot_map))};
      transforms.push_back(transform_of(options_.team_frame, frame, own->part_from_robot_map));
    }
    return transforms;
  }

  std::vector<geometry_msgs::TransformStamped> transforms() {
    std::vector<geometry_msgs::TransformStamped> transforms = team_;
    std::set<std::string> odometry_frames;
    for (const auto& robot : robots_) {
      const auto correction = robot->correction(transforms_);
      if (!correction) continue;
      if (odometry_frames.insert(correction->odometry_frame).second)
        transforms.push_back(transform_of(robot->frame(), correction->odometry_frame, correction->map_from_odometry));
      else
        problems_.say("no transform " + robot->frame() + " -> " + correction->odometry_frame,
                      "another robot's odometry frame has this name; give each robot's a name of its own");
    }
    return transforms;
  }

  const RosNames names_;
  const MapPublisherOptions options_;
  Problems problems_;
  const GridMaker make_grid_;
  const std::string prefix_;
  std::shared_ptr<const runtime::LivePreview> preview_;
  std::uint64_t version_ = 0, looks_ = 0;  // of the preview; of what its largest part looks like
  std::vector<geometry_msgs::TransformStamped> team_;
  tf2_ros::Buffer transforms_{ros::Duration(kKeptTransforms_s), false};
  GridTopic grid_;
  OnDemandTopic<sensor_msgs::PointCloud2> cloud_;
  OnDemandTopic<visualization_msgs::MarkerArray> graph_;
  std::vector<std::unique_ptr<RobotPublisher>> robots_;
  TransformSender sender_;
  std::optional<tf2_ros::TransformListener> listener_;
};

MapPublisher::MapPublisher(ros::NodeHandle node, RosNames names, MapPublisherOptions options, WorkerPool& pool)
    : state_(std::make_unique<State>(std::move(node), std::move(names), std::move(options), pool)) {}

MapPublisher::~MapPublisher() = default;

void MapPublisher::publish(const std::shared_ptr<const runtime::LivePreview>& preview) { state_->publish(preview); }

}  // namespace mapweave::ros_nodes
