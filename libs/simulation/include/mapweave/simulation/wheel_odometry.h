#pragma once
// What the wheels say about a motion: its true increments, falsified.

#include <mapweave/core/geometry.h>
#include <mapweave/simulation/random.h>

#include <string_view>

namespace mapweave::simulation {

struct WheelOdometryOptions {
  int steps_per_scan = 2;
  double noise_m = 0.01;
  double yaw_noise_deg = 0.3;
  double turn_noise_deg = 1.0;
  double scale_error = 0.01;
  double turn_scale_error = 0.01;
  double heading_drift_deg_per_m = 0.1;
  double slips_per_100_m = 0.5;
  double slip_min_deg = 3.0;
  double slip_max_deg = 10.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("steps_per_scan", steps_per_scan, 1, 100,
              "odometry readings for each scan; larger values give more readings");
    v.number("noise_m", noise_m, 0.0, 1.0,
             "standard deviation in metres of the position, along and across, after 1 m of path; grows with the square "
             "root of the path; larger values give worse odometry");
    v.number("yaw_noise_deg", yaw_noise_deg, 0.0, 90.0,
             "standard deviation in degrees of the heading after 1 m straight ahead; grows with the square root of the "
             "path; larger values give worse odometry");
    v.number("turn_noise_deg", turn_noise_deg, 0.0, 90.0,
             "standard deviation in degrees of the heading after one full turn; grows with the square root of the "
             "turn; larger values give worse odometry");
    v.number("scale_error", scale_error, 0.0, 0.5,
             "standard deviation, over robots, of a constant error of path lengths, as a share; larger values give "
             "worse odometry");
    v.number(
        "turn_scale_error", turn_scale_error, 0.0, 0.5,
        "standard deviation, over robots, of a constant error of turns, as a share; larger values give worse odometry");
    v.number("heading_drift_deg_per_m", heading_drift_deg_per_m, 0.0, 90.0,
             "standard deviation, over robots, of a constant drift of the heading in degrees per metre; larger values "
             "give worse odometry");
    v.number("slips_per_100_m", slips_per_100_m, 0.0, 1000.0,
             "number of sudden slips of the wheels, which falsify the heading, on 100 metres that they roll; larger "
             "values give worse odometry");
    v.number("slip_min_deg", slip_min_deg, 0.0, 180.0,
             "size in degrees of the smallest slip; larger values give worse odometry");
    v.number("slip_max_deg", slip_max_deg, 0.0, 180.0,
             "size in degrees of the largest slip, to either side; larger values give worse odometry");
  }
};
WheelOdometryOptions perfect_odometry();  // no error of any kind

class WheelOdometry {
 public:
  // The robot's name keys its numbers.
  WheelOdometry(const WheelOdometryOptions& options, std::uint64_t seed, std::string_view robot);
  // Odometry starts at (0, 0, 0) at the first pose. Poses follow one another closely (a step of odometry apart).
  Pose2 step(const Pose2& world_from_robot);
  Pose2 carry(const Pose2& world_from_robot);  // the same, with the wheels in the air
  int slips() const { return slips_; }

 private:
  WheelOdometryOptions options_;
  RandomStream numbers_;
  double scale_ = 1.0, turn_scale_ = 1.0, drift_rad_per_m_ = 0.0;
  std::uint64_t steps_ = 0;
  Pose2 world_from_last_{}, odometry_from_last_{};
  int slips_ = 0;
};

}  // namespace mapweave::simulation
