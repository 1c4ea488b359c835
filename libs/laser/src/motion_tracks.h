#pragma once
// What wheels and the inertial unit say of the robot's motion, at any stamp.

#include <mapweave/core/geometry.h>
#include <mapweave/core/stamp.h>

#include <deque>
#include <optional>
#include <utility>

namespace mapweave::laser {

constexpr double kInertialGap_s = 0.25;  // readings of the inertial unit farther apart say nothing of what is between
constexpr double kLongestStep_s = 0.5;   // from scan to scan: else the turn rate is not known

// Accumulated odometry at any stamp: between readings by interpolation, shortly after the last one by going on as
// in the last 0.05 s or more before it, however close readings are stamped.
class OdometryTrack {
 public:
  void add(Stamp stamp, const Pose2& odometry_from_robot);
  std::optional<Pose2> at(Stamp stamp) const;  // nullopt before the first reading and long after the last
  std::optional<Stamp> latest() const;

 private:
  std::optional<Pose2> ahead(Stamp stamp) const;  // of the last reading
  std::deque<std::pair<Stamp, Pose2>> readings_;
};

// Turns as the inertial unit measures them; what they are worth: inertial_calibration.h.
class InertialTrack {
 public:
  void add(Stamp stamp, double yaw_rad);
  // The turn between two stamps; nullopt where readings are missing.
  std::optional<double> turn(Stamp from, Stamp to) const;
  std::optional<Stamp> latest() const;

 private:
  std::optional<double> at(Stamp stamp) const;
  std::deque<std::pair<Stamp, double>> readings_;
};

}  // namespace mapweave::laser
