#include <mapweave/simulation/wheel_odometry.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {
constexpr double kRadians = M_PI / 180.0;
constexpr double kHalfAxle = 0.2;  // metres: how far the wheels roll in a turn
}  // namespace

WheelOdometryOptions perfect_odometry() {
  WheelOdometryOptions options;
  options.noise_m = options.yaw_noise_deg = options.turn_noise_deg = 0.0;
  options.scale_error = options.turn_scale_error = options.heading_drift_deg_per_m = options.slips_per_100_m = 0.0;
  return options;
}

WheelOdometry::WheelOdometry(const WheelOdometryOptions& options, std::uint64_t seed, std::string_view robot)
    : options_(options), numbers_(seed, "odometry", robot) {
  RandomNumbers numbers = RandomStream(seed, "wheels", robot).at(0);
  scale_ = 1.0 + std::clamp(numbers.normal(), -3.0, 3.0) * options.scale_error;
  turn_scale_ = 1.0 + std::clamp(numbers.normal(), -3.0, 3.0) * options.turn_scale_error;
  drift_rad_per_m_ = std::clamp(numbers.normal(), -3.0, 3.0) * options.heading_drift_deg_per_m * kRadians;
}

Pose2 WheelOdometry::step(const Pose2& world_from_robot) {
  const std::uint64_t index = steps_++;
  if (index > 0) {
    const Pose2 last_from_robot = between(world_from_last_, world_from_robot);
    const double path = std::hypot(last_from_robot.x, last_from_robot.y), turn = std::abs(last_from_robot.phi);
    RandomNumbers numbers = numbers_.at(index);
    const double along = numbers.normal() * options_.noise_m * std::sqrt(path),
                 across = numbers.normal() * options_.noise_m * std::sqrt(path);
    const double yaw = numbers.normal() * kRadians *
                       std::sqrt(options_.yaw_noise_deg * options_.yaw_noise_deg * path +
                                 options_.turn_noise_deg * options_.turn_noise_deg * turn / (2.0 * M_PI));
    const double rolled = path + kHalfAxle * turn;
    double slip = 0.0;
    if (numbers.uniform() < -std::expm1(-options_.slips_per_100_m * rolled / 100.0)) {
      slip = numbers.uniform(options_.slip_min_deg, std::max(options_.slip_min_deg, options_.slip_max_deg)) * kRadians;
      if (numbers.chance(0.5)) slip = -slip;
      ++slips_;
    }
    odometry_from_last_ =
        compose(odometry_from_last_, {last_from_robot.x * scale_ + along, last_from_robot.y * scale_ + across,
                                      last_from_robot.phi * turn_scale_ + drift_rad_per_m_ * path + yaw + slip});
  }
  world_from_last_ = world_from_robot;
  return odometry_from_last_;
}

Pose2 WheelOdometry::carry(const Pose2& world_from_robot) {
  ++steps_;
  world_from_last_ = world_from_robot;
  return odometry_from_last_;
}

}  // namespace mapweave::simulation
