#include "sensor_mounts.h"

#include "../camera_folder.h"
#include "../say_once.h"

#include <mapweave/rawlog/ros_recorder.h>

#include <limits>

namespace mapweave::rawlog::ros {
SensorMounts::SensorMounts(const ChosenTopics& topics, const ReadOptions& options, std::string bag)
    : options_(options),
      bag_(std::move(bag)),
      uses_transforms_(options.use_tf && topics.has_transforms),
      has_odometry_topic_(topics.has_odometry),
      awaits_odometry_(topics.has_odometry),
      last_odometry_ns_(std::numeric_limits<std::int64_t>::min()) {
  if (options.use_tf && !topics.has_transforms)
    say_once(bag_ +
             ": there are no transforms (/tf, /tf_static), so sensors are taken to stand at the robot's origin, "
             "lasers as reading.laser_x_m, laser_y_m and laser_yaw_rad say");
}

std::vector<TransformedOdometry> SensorMounts::add(MessageReader& reader, bool is_static) {
  std::vector<TransformedOdometry> odometry;
  for (const TransformMessage& transform : read_transforms(reader)) {
    const std::string parent = frame_name(transform.header.frame_id), child = frame_name(transform.child_frame_id);
    const std::int64_t stamp_ns = transform.header.stamp_ns;
    if (parent.empty() || child.empty() || parent == child || !transform.is_rotation ||
        !transform.parent_from_child.t.allFinite()) {
      say_once(bag_ + ": a transform '" + parent + "' -> '" + child + "' makes no sense and is left out");
      continue;
    }
    transforms_.add(parent, child, stamp_ns, transform.parent_from_child, is_static);
    if (has_odometry_topic_ || is_static || !is_odometry_frame(parent)) continue;
    if (odometry_child_.empty()) {
      odometry_parent_ = parent;
      odometry_child_ = child;
    }
    if (parent != odometry_parent_ || child != odometry_child_ || stamp_ns <= last_odometry_ns_) continue;
    last_odometry_ns_ = stamp_ns;
    odometry.push_back({stamp_ns, transform.parent_from_child});
  }
  return odometry;
}

void SensorMounts::note_odometry_child(const std::string& frame) {
  awaits_odometry_ = false;
  if (odometry_child_.empty()) odometry_child_ = frame;
}

std::optional<std::string> SensorMounts::robot_frame(bool is_final) const {
  if (!options_.robot_frame.empty()) return frame_name(options_.robot_frame);
  if (!odometry_child_.empty()) return odometry_child_;
  if (awaits_odometry_ && !is_final) return std::nullopt;
  const std::string prefix = options_.robot_namespace.empty() ? "" : frame_name(options_.robot_namespace) + "/";
  for (const std::string& name :
       {prefix + "base_footprint", prefix + "base_link", std::string("base_footprint"), std::string("base_link")})
    if (transforms_.knows(name)) return name;
  return std::nullopt;
}

Pose3 SensorMounts::without_transforms(TopicRole role) const {
  if (role == TopicRole::image || role == TopicRole::depth_image) {
    const mrpt::poses::CPose3D ahead = looking_ahead();
    return {Eigen::Vector3d::Zero(),
            Eigen::Quaterniond(Eigen::Matrix3d(ahead.getRotationMatrix().asEigen())).normalized()};
  }
  if (role == TopicRole::imu || role == TopicRole::position || role == TopicRole::odometry) return {};
  return spatial(Pose2(options_.laser_x_m, options_.laser_y_m, options_.laser_yaw_rad));
}

Mount SensorMounts::find(TopicRole role, const std::string& frame, std::int64_t stamp_ns, bool is_final) const {
  if (role == TopicRole::odometry && (frame.empty() || frame == robot_frame(is_final))) return {Pose3{}, {}, false};
  if (!uses_transforms_) return {without_transforms(role), {}, false};
  const auto robot = robot_frame(is_final);
  if (!robot)
    return {std::nullopt, "the robot's frame is not known: there is neither odometry nor base_footprint or base_link",
            false};
  if (frame == *robot) return {Pose3{}, {}, false};
  const TransformAnswer answer = transforms_.find(*robot, frame, stamp_ns, is_final);
  if (answer.pose) return {answer.pose, {}, false};
  return {std::nullopt, "no transform leads from '" + *robot + "' to '" + frame + "': " + answer.why_not,
          answer.is_before_first};
}

}  // namespace mapweave::rawlog::ros
