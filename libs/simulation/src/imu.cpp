#include <mapweave/simulation/imu.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

constexpr double kGravity = 9.81;  // m/s^2
constexpr double kSmoothing =
    0.03;  // seconds before and after: the unit's own filter, and paths are made of straight pieces

Eigen::Vector3d normal_vector(RandomNumbers& numbers) {
  const double x = numbers.normal(), y = numbers.normal(), z = numbers.normal();
  return {x, y, z};
}

}  // namespace

ImuRecording::ImuRecording(const World& world, std::size_t robot)
    : world_(&world),
      robot_(robot),
      options_(world.options().imu),
      numbers_(static_cast<std::uint64_t>(world.options().seed), "inertial unit", world.robot_id(robot).str()) {
  if (options_.readings_per_second > 0.0)
    count_ = static_cast<std::size_t>(world.trajectory(robot).duration_s() * options_.readings_per_second) + 1;
  RandomNumbers numbers = numbers_.at(0);
  turn_bias_ = options_.gyro_bias * normal_vector(numbers);
  acceleration_bias_ = options_.accelerometer_bias * normal_vector(numbers);
}

double ImuRecording::seconds(std::size_t reading) const {
  return std::round(static_cast<double>(reading) * 1e6 / options_.readings_per_second) * 1e-6;
}

Stamp ImuRecording::stamp() const {
  return Stamp{world_->first_stamp(robot_).ns + std::llround(seconds(next_) * 1e6) * 1000};
}

std::optional<ImuReading> ImuRecording::next() {
  if (next_ >= count_) return std::nullopt;
  const double at = seconds(next_), rate = options_.readings_per_second;
  ImuReading reading{stamp(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  ++next_;
  const Pose3 now = world_->world_from_robot(robot_, at);
  Eigen::Vector3d push(0.0, 0.0, kGravity);           // world frame
  if (!world_->is_carried(robot_, at, kSmoothing)) {  // else it is held still, as far as it can tell
    const Pose3 before = world_->world_from_robot(robot_, at - kSmoothing),
                after = world_->world_from_robot(robot_, at + kSmoothing);
    const Eigen::AngleAxisd turn(before.q.conjugate() * after.q);
    const double angle = wrap_angle(turn.angle());
    reading.turn_rad_per_s = turn.axis() * (angle / (2.0 * kSmoothing));
    push += (before.t - 2.0 * now.t + after.t) / (kSmoothing * kSmoothing);
  }
  reading.acceleration_m_per_s2 = now.q.conjugate() * push;
  RandomNumbers numbers = numbers_.at(next_);
  const double noise = std::sqrt(rate), walk = 1.0 / noise;  // of densities: white noise, and a step of a walk
  reading.turn_rad_per_s += turn_bias_ + options_.gyro_noise * noise * normal_vector(numbers);
  reading.turn_rad_per_s *= options_.gyro_scale;
  reading.acceleration_m_per_s2 += acceleration_bias_ + options_.accelerometer_noise * noise * normal_vector(numbers);
  turn_bias_ += options_.gyro_walk * walk * normal_vector(numbers);
  acceleration_bias_ += options_.accelerometer_walk * walk * normal_vector(numbers);
  return reading;
}

}  // namespace mapweave::simulation
