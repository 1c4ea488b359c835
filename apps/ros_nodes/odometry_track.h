#pragma once
// Where a robot's odometry was at a time, and what its map has to correct of it.

#include <mapweave/core/stamped_pose.h>

#include <nav_msgs/Odometry.h>

#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::ros_nodes {

struct OdometryPose {
  std::string frame;        // of the odometry
  std::string robot_frame;  // of the robot's base; may be empty
  Pose3 odometry_from_robot;
};

// A frame's name as tf2 has it: without the '/' that ROS once put before it.
std::string without_slash(const std::string& frame);

// The last minutes of one topic of nav_msgs/Odometry. All calls are thread-safe.
class OdometryTrack {
 public:
  explicit OdometryTrack(double kept_s = 600.0, double longest_gap_s = 1.0);

  // Messages without a frame, with numbers that are not finite or without a rotation are left out. Another frame, or a
  // stamp before the last one (a recording that begins again), starts the track anew.
  void add(const nav_msgs::Odometry&);
  // Interpolated; nullopt before the first message, after the last, and in gaps longer than longest_gap_s.
  std::optional<OdometryPose> at(Stamp) const;
  // The names of the last message's frames, with no pose of meaning; nullopt: there was none.
  std::optional<OdometryPose> frames() const;

 private:
  const double kept_s_, longest_gap_s_;
  mutable std::mutex mutex_;
  std::string frame_, robot_frame_;
  std::vector<StampedPose> poses_;  // by stamp; what is too old is erased in blocks
};

// map_from_odometry of one robot: its pose in the map at the newest time at which both are known, on the inverse of its
// odometry then. Where the newest node's odometry is unknown, it goes on from the node whose odometry was known last,
// at the pose that this node has now. Not thread-safe.
class OdometryCorrection {
 public:
  using Look = std::function<std::optional<OdometryPose>(Stamp)>;
  struct Result {
    std::string odometry_frame;
    Pose3 map_from_odometry;
  };
  // trajectory: the robot's poses in its map, by stamp. nullopt: no pose's odometry was known yet.
  std::optional<Result> update(const std::vector<StampedPose>& trajectory, const Look& odometry_at);

 private:
  Stamp stamp_;
  std::optional<OdometryPose> known_;  // at stamp_
};

}  // namespace mapweave::ros_nodes
