#include "carrying.h"

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {

SimulatedTrajectory carried_away(const SimulatedTrajectory& planned, const RobotOptions& robot,
                                 std::vector<Carry>& carries) {
  std::vector<SimulatedTrajectory::Knot> knots;
  double path_m = 0.0, delay_s = 0.0;
  auto next = robot.kidnappings.begin();
  const auto& all = planned.knots();
  const auto step_of = [&](std::size_t i) {
    const Pose2 &a = all[i - 1].world_from_robot, &b = all[i].world_from_robot;
    return std::hypot(b.x - a.x, b.y - a.y);
  };
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i > 0) path_m += step_of(i);
    knots.push_back(all[i]);
    knots.back().seconds += delay_s;
    if (next == robot.kidnappings.end() || path_m < next->after_m) continue;
    const double down_m = path_m + next->skip_m;
    std::size_t down = i;
    while (down + 1 < all.size() && path_m < down_m) path_m += step_of(++down);
    const double picked_up_s = knots.back().seconds, duration_s = std::max(next->duration_s, 0.001);
    ++next;
    if (down == i || down + 1 >= all.size()) continue;  // nowhere to go on from
    SimulatedTrajectory::Knot put_down = all[down];
    put_down.seconds = picked_up_s + duration_s;
    put_down.speed_m_per_s = knots.back().speed_m_per_s;
    carries.push_back({picked_up_s, put_down.seconds});
    knots.push_back(put_down);
    delay_s = put_down.seconds - all[down].seconds;
    i = down;
  }
  return SimulatedTrajectory(std::move(knots));
}

FloorWaves::FloorWaves(double tilt_deg, std::uint64_t seed) {
  if (tilt_deg <= 0.0) return;
  constexpr int kWaves = 12;
  RandomNumbers numbers = RandomStream(seed, "floor waves").at(0);
  for (int i = 0; i < kWaves; ++i) {
    const double length = 0.4 * std::pow(3.0 / 0.4, static_cast<double>(i) / (kWaves - 1)),
                 angle = numbers.uniform(0.0, 2.0 * M_PI);
    const double number = 2.0 * M_PI / length;
    // A slope's share along any one direction is half of its square, and a cosine's mean square is a half.
    waves_.push_back({number * std::cos(angle), number * std::sin(angle), numbers.uniform(0.0, 2.0 * M_PI),
                      tilt_deg * (M_PI / 180.0) * 2.0 / std::sqrt(static_cast<double>(kWaves))});
  }
}

Pose3 FloorWaves::on_floor(const Pose2& world_from_robot) const {
  Pose3 pose = spatial(world_from_robot);
  if (waves_.empty()) return pose;
  double slope_x = 0.0, slope_y = 0.0;
  for (const Wave& wave : waves_) {
    const double number = std::hypot(wave.x, wave.y),
                 phase = wave.x * world_from_robot.x + wave.y * world_from_robot.y + wave.phase;
    pose.t.z() += wave.slope / number * std::sin(phase);
    slope_x += wave.slope * std::cos(phase) * wave.x / number;
    slope_y += wave.slope * std::cos(phase) * wave.y / number;
  }
  pose.q =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), Eigen::Vector3d(-slope_x, -slope_y, 1.0)) * pose.q;
  return pose;
}

}  // namespace mapweave::simulation
