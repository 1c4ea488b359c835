#include "odometry_track.h"

#include "ros_messages.h"

#include <algorithm>
#include <limits>

namespace mapweave::ros_nodes {

std::string without_slash(const std::string& frame) {
  return !frame.empty() && frame.front() == '/' ? frame.substr(1) : frame;
}

OdometryTrack::OdometryTrack(double kept_s, double longest_gap_s) : kept_s_(kept_s), longest_gap_s_(longest_gap_s) {}

void OdometryTrack::add(const nav_msgs::Odometry& message) {
  const std::string frame = without_slash(message.header.frame_id), robot = without_slash(message.child_frame_id);
  const auto pose = pose_of(message.pose.pose);
  if (!pose || frame.empty()) return;
  const Stamp stamp = stamp_of(message.header.stamp);
  const std::lock_guard lock(mutex_);
  if (frame != frame_ || robot != robot_frame_ || (!poses_.empty() && stamp < poses_.back().stamp)) poses_.clear();
  frame_ = frame;
  robot_frame_ = robot;
  if (!poses_.empty() && poses_.back().stamp == stamp)
    poses_.back().map_from_robot = *pose;
  else
    poses_.push_back({stamp, *pose});
  if (seconds_between(poses_.front().stamp, stamp) < 2.0 * kept_s_) return;
  poses_.erase(poses_.begin(), std::find_if(poses_.begin(), poses_.end(), [&](const StampedPose& one) {
                 return seconds_between(one.stamp, stamp) <= kept_s_;
               }));
}

std::optional<OdometryPose> OdometryTrack::at(Stamp stamp) const {
  const std::lock_guard lock(mutex_);
  const auto pose = pose_at(poses_, stamp, longest_gap_s_);
  return pose ? std::optional(OdometryPose{frame_, robot_frame_, *pose}) : std::nullopt;
}

std::optional<OdometryPose> OdometryTrack::frames() const {
  const std::lock_guard lock(mutex_);
  return frame_.empty() ? std::nullopt : std::optional(OdometryPose{frame_, robot_frame_, {}});
}

std::optional<OdometryCorrection::Result> OdometryCorrection::update(const std::vector<StampedPose>& trajectory,
                                                                     const Look& odometry_at) {
  if (trajectory.empty()) return std::nullopt;
  if (!known_ || stamp_ != trajectory.back().stamp)
    if (auto found = odometry_at(trajectory.back().stamp)) {
      stamp_ = trajectory.back().stamp;
      known_ = std::move(found);
    }
  if (!known_) return std::nullopt;
  // A trajectory may end before what was known, or lack it, once it is of another recording.
  const auto node = pose_at(trajectory, stamp_, std::numeric_limits<double>::infinity());
  if (!node) return std::nullopt;
  return Result{known_->frame, compose(*node, inverse(known_->odometry_from_robot))};
}

}  // namespace mapweave::ros_nodes
