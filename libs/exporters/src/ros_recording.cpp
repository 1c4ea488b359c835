#include <mapweave/exporters/ros_recording.h>

#include "ros_message.h"

#include <mapweave/core/error.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/exporters/session_trajectories.h>

#include <algorithm>
#include <cctype>
#include <limits>
#include <map>
#include <set>

namespace mapweave::exporters {
namespace {

constexpr std::int64_t kNanoseconds = 1'000'000'000;
constexpr std::uint8_t kFloat32 = 7;  // sensor_msgs/PointField
constexpr std::uint32_t kPointBytes = 16;

class RecordingMaker {
 public:
  explicit RecordingMaker(RosGeneration generation) : generation_(generation) {}

  RosRecording recording_of(const std::vector<RecordedMap>& maps) {
    std::vector<std::map<RobotId, std::vector<StampedPose>>> trajectories;
    for (const RecordedMap& one : maps) trajectories.push_back(robot_trajectories(*one.map));
    first_ = first_stamp(maps, trajectories);
    add_topics();
    for (std::size_t i = 0; i < maps.size(); ++i) {
      const std::string prefix =
          maps.size() == 1 ? "" : "maps/" + unique_ros_name(maps[i].map->id.str(), map_names_) + "/";
      add_map(maps[i], prefix);
      for (const auto& [robot, poses] : trajectories[i]) add_robot(robot, poses, prefix + "map");
    }
    if (!static_.empty()) {
      RosMessageWriter message(generation_);
      message.put_count(static_.size());
      for (const Transform& transform : static_) put_transform(message, first_, transform);
      add(static_topic_, first_, message.take());
    }
    std::stable_sort(recording_.messages.begin(), recording_.messages.end(),
                     [](const RosMessage& a, const RosMessage& b) { return a.time_ns < b.time_ns; });
    return std::move(recording_);
  }

 private:
  struct Transform {
    std::string parent, child;
    Pose3 parent_from_child;
  };

  static Stamp first_stamp(const std::vector<RecordedMap>& maps,
                           const std::vector<std::map<RobotId, std::vector<StampedPose>>>& trajectories) {
    Stamp first{std::numeric_limits<std::int64_t>::max()};
    for (const auto& robots : trajectories)
      for (const auto& [robot, poses] : robots) first = std::min(first, poses.front().stamp);
    if (first.ns != std::numeric_limits<std::int64_t>::max()) return first;
    // A grid of map_server alone: no robot has a pose.
    for (const RecordedMap& one : maps)
      for (const auto& [id, node] : one.map->nodes) first = std::min(first, node.stamp);
    return first.ns == std::numeric_limits<std::int64_t>::max() ? Stamp{kNanoseconds} : first;
  }

  void add_topics() {
    tf_topic_ = topic("/tf", RosType::transforms, false);
    static_topic_ = topic("/tf_static", RosType::transforms, true);
  }

  std::size_t topic(const std::string& name, RosType type, bool latched) {
    recording_.topics.push_back({name, type, latched});
    return recording_.topics.size() - 1;
  }

  void add(std::size_t topic, Stamp stamp, std::string bytes) {
    // ROS 1 takes a message at time 0 for one without time.
    recording_.messages.push_back({topic, std::max<std::int64_t>(expected(stamp).ns, 1), std::move(bytes)});
  }

  Stamp expected(Stamp stamp) const {
    const std::int64_t last_s = generation_ == RosGeneration::ros1 ? std::numeric_limits<std::uint32_t>::max()
                                                                   : std::numeric_limits<std::int32_t>::max();
    if (stamp.ns >= 0 && stamp.ns / kNanoseconds <= last_s) return stamp;
    throw Error(ErrorCode::kBadInput,
                "the map has a stamp of " + std::to_string(stamp.ns / kNanoseconds) + " s; messages of ROS hold 0 to " +
                    std::to_string(last_s) + " s after 1970",
                {}, "map a recording with stamps of that time");
  }

  void add_map(const RecordedMap& one, const std::string& prefix) {
    const std::string frame = prefix + "map";
    if (one.grid != nullptr && !one.grid->empty())
      add(topic("/" + frame, RosType::occupancy_grid, true), first_, grid_message(*one.grid, frame));
    if (!one.points.empty())
      add(topic("/" + prefix + "points", RosType::point_cloud, true), first_, cloud_message(one.points, frame));
  }

  std::string grid_message(const OccupancyGrid& grid, const std::string& frame) const {
    RosMessageWriter message(generation_);
    message.put_header(first_, frame).put_time(first_);
    message.put(static_cast<float>(grid.resolution_m));
    message.put(static_cast<std::uint32_t>(grid.columns)).put(static_cast<std::uint32_t>(grid.rows));
    message.put_pose({{grid.origin_x_m, grid.origin_y_m, 0.0}, Eigen::Quaterniond::Identity()});
    std::string cells;
    cells.reserve(grid.log_odds.size());
    for (const std::int16_t log_odds : grid.log_odds) cells += static_cast<char>(served_occupancy(log_odds));
    return message.put_bytes(cells).take();
  }

  std::string cloud_message(const std::vector<ColouredPoint>& points, const std::string& frame) const {
    RosMessageWriter message(generation_);
    message.put_header(first_, frame).put(std::uint32_t{1}).put_count(points.size());
    const char* const names[] = {"x", "y", "z", "rgb"};
    message.put_count(std::size(names));
    std::uint32_t offset = 0;
    for (const char* name : names) {
      message.put_text(name).put(offset).put(kFloat32).put(std::uint32_t{1});
      offset += sizeof(float);
    }
    message.put(std::uint8_t{0}).put(kPointBytes).put(static_cast<std::uint32_t>(kPointBytes * points.size()));
    std::string data;
    data.reserve(kPointBytes * points.size());
    for (const auto& [point, rgb] : points) {
      for (int axis = 0; axis < 3; ++axis) append_number(data, point(axis));
      append_number(data, rgb);
    }
    return message.put_bytes(data).put(std::uint8_t{1}).take();
  }

  void add_robot(const RobotId& robot, const std::vector<StampedPose>& poses, const std::string& frame) {
    const std::string name = unique_ros_name(robot.str(), robot_names_), own_map = name + "/map",
                      base = name + "/base_link";
    RosMessageWriter path(generation_);
    path.put_header(first_, frame).put_count(poses.size());
    for (const StampedPose& pose : poses) path.put_header(expected(pose.stamp), frame).put_pose(pose.map_from_robot);
    add(topic("/" + name + "/path", RosType::path, true), first_, path.take());
    const Pose3& start = poses.front().map_from_robot;
    static_.push_back({frame, own_map, start});
    for (std::size_t i = 0; i < poses.size(); ++i) {
      if (i > 0 && poses[i].stamp == poses[i - 1].stamp) continue;  // tf knows one pose at a time
      RosMessageWriter message(generation_);
      message.put_count(1);
      put_transform(message, poses[i].stamp, {own_map, base, between(start, poses[i].map_from_robot)});
      add(tf_topic_, poses[i].stamp, message.take());
    }
  }

  static void put_transform(RosMessageWriter& message, Stamp stamp, const Transform& transform) {
    message.put_header(stamp, transform.parent).put_text(transform.child).put_pose(transform.parent_from_child);
  }

  RosGeneration generation_;
  RosRecording recording_;
  Stamp first_;
  std::size_t tf_topic_ = 0, static_topic_ = 0;
  std::vector<Transform> static_;
  std::set<std::string> robot_names_ = {"map", "maps", "points", "tf", "tf_static"}, map_names_;
};

}  // namespace

std::string ros_name(std::string_view text) {
  std::string name;
  for (const char letter : text)
    name += std::isalnum(static_cast<unsigned char>(letter)) != 0 && static_cast<unsigned char>(letter) < 128 ? letter
                                                                                                              : '_';
  if (name.empty() || std::isalpha(static_cast<unsigned char>(name.front())) == 0) name.insert(0, "r");
  return name;
}

std::string unique_ros_name(std::string_view text, std::set<std::string>& taken) {
  const std::string name = ros_name(text);
  std::string unique = name;
  for (int number = 2; !taken.insert(unique).second; ++number) unique = name + "_" + std::to_string(number);
  return unique;
}

std::string ros1_bag_bytes(const std::vector<RecordedMap>& maps) {
  return ros1_bag_of(RecordingMaker(RosGeneration::ros1).recording_of(maps));
}

std::string ros2_mcap_bytes(const std::vector<RecordedMap>& maps) {
  return mcap_of(RecordingMaker(RosGeneration::ros2).recording_of(maps));
}

}  // namespace mapweave::exporters
