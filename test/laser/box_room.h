#pragma once
// A room of 8 x 6 m with a pillar, and a robot that drives a rounded path in it: a world whose scans are computed by
// hand, for tests that must not depend on any other library's simulation.

#include <mapweave/laser/laser_mapper.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace mapweave::laser::test {

struct Wall {
  double x0, y0, x1, y1;
};

inline const std::vector<Wall>& box_room() {
  static const std::vector<Wall> walls{{-4, -3, 4, -3},       {4, -3, 4, 3},         {4, 3, 1, 3},
                                       {1, 3, 1, 2.4},        {1, 2.4, -1, 2.4},     {-1, 2.4, -1, 3},
                                       {-1, 3, -4, 3},        {-4, 3, -4, -3},       {-0.5, -0.4, 0.3, -0.4},
                                       {0.3, -0.4, 0.3, 0.4}, {0.3, 0.4, -0.5, 0.4}, {-0.5, 0.4, -0.5, -0.4}};
  return walls;
}

inline std::shared_ptr<const ScanGeometry> half_circle_laser() {
  auto geometry = std::make_shared<ScanGeometry>();
  geometry->first_angle_rad = -M_PI / 2;
  geometry->angle_step_rad = M_PI / 180;
  geometry->ray_count = 181;
  geometry->max_range_m = 20.0;
  geometry->robot_from_laser.t = {0.1, 0.0, 0.3};
  return geometry;
}

// A deviate of about unit variance from the engine alone (std distributions differ between libraries).
inline double deviate(std::mt19937_64& engine) {
  double sum = -6.0;
  for (int i = 0; i < 12; ++i) sum += static_cast<double>(engine() >> 11) * 0x1p-53;
  return sum;
}

inline PackedScan scan_from(const Pose2& room_from_robot, const std::shared_ptr<const ScanGeometry>& geometry,
                            std::mt19937_64& noise) {
  PackedScan scan{geometry, std::vector<std::uint16_t>(geometry->ray_count, 0)};
  const Pose2 room_from_laser = compose(room_from_robot, planar(geometry->robot_from_laser));
  for (std::uint32_t ray = 0; ray < geometry->ray_count; ++ray) {
    const double angle = room_from_laser.phi + geometry->first_angle_rad + ray * geometry->angle_step_rad;
    const double dx = std::cos(angle), dy = std::sin(angle);
    double nearest = std::numeric_limits<double>::infinity();
    for (const Wall& wall : box_room()) {
      const double wx = wall.x1 - wall.x0, wy = wall.y1 - wall.y0, cross = dx * wy - dy * wx;
      if (std::abs(cross) < 1e-12) continue;
      const double ox = wall.x0 - room_from_laser.x, oy = wall.y0 - room_from_laser.y;
      const double range = (ox * wy - oy * wx) / cross, along = (ox * dy - oy * dx) / cross;
      if (range > 0 && along >= 0 && along <= 1) nearest = std::min(nearest, range);
    }
    const double measured = nearest + 0.01 * deviate(noise);
    if (measured < geometry->max_range_m)
      scan.ranges[ray] = static_cast<std::uint16_t>(std::lround(measured / geometry->range_unit_m));
  }
  return scan;
}

struct Drive {
  std::vector<LaserInput> inputs;  // odometry (where wanted) and scan of each step
  std::vector<Pose2> room_from_robot;
};

// Rounds of an ellipse about the pillar at 5 scans/s. Odometry slips by 5 % of the path and 3 % of turns.
inline Drive drive_around(int scans, bool with_odometry, std::uint64_t seed = 7) {
  Drive drive;
  std::mt19937_64 noise(seed);
  const auto geometry = half_circle_laser();
  Pose2 odometry_from_robot{3.0, -1.0, 0.4}, before;
  for (int i = 0; i < scans; ++i) {
    const double angle = 0.025 * i;
    const Pose2 truth{2.4 * std::sin(angle), -1.5 * std::cos(angle),
                      std::atan2(1.5 * std::sin(angle), 2.4 * std::cos(angle))};
    if (i > 0) {
      const Pose2 motion = between(before, truth);
      odometry_from_robot = compose(odometry_from_robot, {motion.x * 1.05, motion.y, motion.phi * 1.03});
    }
    before = truth;
    const Stamp stamp{1'000'000'000'000'000'000 + std::int64_t{200'000'000} * i};
    if (with_odometry) drive.inputs.push_back(OdometryInput{stamp, spatial(odometry_from_robot)});
    drive.inputs.push_back(ScanInput{stamp, scan_from(truth, geometry, noise)});
    drive.room_from_robot.push_back(truth);
  }
  return drive;
}

}  // namespace mapweave::laser::test
