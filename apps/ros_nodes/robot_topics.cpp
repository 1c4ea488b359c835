#include "robot_topics.h"

#include <mapweave/core/error.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/MultiEchoLaserScan.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace mapweave::ros_nodes {
namespace {

// Known by their definitions, which other programs need to read the recording.
const std::map<std::string, std::string>& definitions() {
  static const auto entry = [](auto message) {
    using Type = decltype(message);
    return std::pair<std::string, std::string>(ros::message_traits::DataType<Type>::value(),
                                               ros::message_traits::Definition<Type>::value());
  };
  static const std::map<std::string, std::string> all = {
      entry(sensor_msgs::LaserScan()),
      entry(sensor_msgs::MultiEchoLaserScan()),
      entry(sensor_msgs::PointCloud2()),
      entry(sensor_msgs::Imu()),
      entry(sensor_msgs::NavSatFix()),
      entry(sensor_msgs::Image()),
      entry(sensor_msgs::CompressedImage()),
      entry(sensor_msgs::CameraInfo()),
      entry(nav_msgs::Odometry()),
      entry(tf2_msgs::TFMessage()),
      {"tf/tfMessage", ros::message_traits::Definition<tf2_msgs::TFMessage>::value()}};
  return all;
}

bool is_of_range(const std::string& type) {
  return type == "sensor_msgs/LaserScan" || type == "sensor_msgs/MultiEchoLaserScan" ||
         type == "sensor_msgs/PointCloud2";
}

bool has_prefix(const std::string& text, const std::string& prefix) {
  return text.compare(0, prefix.size(), prefix) == 0;
}

// The topics that are there, by the names that this node has for them: remapped ones by the names that they stand for.
std::vector<rawlog::RecordedTopic> topics_seen(const ros::master::V_TopicInfo& published) {
  std::map<std::string, std::string> name_of;
  for (const auto& [from, to] : ros::names::getRemappings()) name_of[to] = from;
  std::vector<rawlog::RecordedTopic> there;
  for (const ros::master::TopicInfo& topic : published) {
    const auto definition = definitions().find(topic.datatype);
    if (definition == definitions().end() || ros::names::getRemappings().count(topic.name) != 0) continue;
    const auto name = name_of.find(topic.name);
    there.push_back({name != name_of.end() ? name->second : topic.name, topic.datatype, definition->second});
  }
  std::sort(there.begin(), there.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return there;
}

// A robot's topic that was remapped is the one of its type.
void drop_others(std::vector<rawlog::RecordedTopic>& there, const std::string& prefix) {
  std::set<std::string> named, types;
  for (const rawlog::RecordedTopic& topic : there)
    if (has_prefix(topic.name, prefix) && !is_of_transforms(topic.type) &&
        ros::names::getRemappings().count(topic.name) != 0) {
      named.insert(topic.name);
      types.insert(topic.type);
    }
  there.erase(std::remove_if(there.begin(), there.end(),
                             [&](const rawlog::RecordedTopic& topic) {
                               return has_prefix(topic.name, prefix) && types.count(topic.type) != 0 &&
                                      named.count(topic.name) == 0;
                             }),
              there.end());
}

}  // namespace

bool is_of_transforms(const std::string& type) { return type == "tf2_msgs/TFMessage" || type == "tf/tfMessage"; }

RobotTopics::RobotTopics(const runtime::PlannedRobot& robot, const runtime::RunConfiguration& configuration)
    : robot_(robot.id),
      reading_(configuration_of(configuration, robot).reading),
      sensor_(configuration_of(configuration, robot).sensor),
      is_alone_(configuration.robots.size() == 1) {}

std::optional<RobotTopics::Seen> RobotTopics::look() const {
  ros::master::V_TopicInfo published;
  if (!ros::master::getTopics(published)) return std::nullopt;
  Seen seen{topics_seen(published), "/", reading_};
  const bool has_own = std::any_of(seen.topics.begin(), seen.topics.end(), [&](const rawlog::RecordedTopic& topic) {
    return has_prefix(topic.name, "/" + robot_.str() + "/");
  });
  std::string& robot_namespace = seen.reading.robot_namespace;
  if (robot_namespace.empty() && (has_own || !is_alone_)) robot_namespace = robot_.str();
  if (!robot_namespace.empty()) seen.prefix = "/" + robot_namespace + "/";
  if (reading_.topics.empty()) drop_others(seen.topics, seen.prefix);
  for (const rawlog::RecordedTopic& topic : seen.topics) {
    if (!has_prefix(topic.name, seen.prefix)) continue;
    seen.has_range = seen.has_range || is_of_range(topic.type);
    seen.can_map = seen.can_map || (!is_of_transforms(topic.type) && topic.type != "nav_msgs/Odometry" &&
                                    topic.type != "sensor_msgs/Imu" && topic.type != "sensor_msgs/NavSatFix");
  }
  return seen;
}

std::vector<rawlog::RecordedTopic> RobotTopics::chosen(const Seen& seen) const {
  const bool with_cameras = sensor_ != "laser" && (sensor_ != "auto" || !seen.has_range);
  return topics_to_record(seen.topics, seen.reading, with_cameras, "robot " + robot_.str());
}

std::optional<std::string> RobotTopics::odometry() const {
  const auto seen = look();
  if (!seen) return std::nullopt;
  try {
    for (const rawlog::RecordedTopic& topic : chosen(*seen))
      if (topic.type == "nav_msgs/Odometry") return topic.name;
  } catch (const Error&) {  // who records it says so
  }
  return std::nullopt;
}

}  // namespace mapweave::ros_nodes
