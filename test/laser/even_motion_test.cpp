// Scans of a robot that speeds up, brakes or begins to turn while its laser turns.
#include "even_motion.h"

#include "box_room.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace mapweave::laser {
namespace {

using test::box_room;
using Track = std::function<std::optional<Pose2>(double)>;

constexpr double kSweep_s = 0.1;

struct Laser {
  bool clockwise = false, upside_down = false;
  double stamp = 0.0;  // the part of the sweep that is over
};

std::shared_ptr<const ScanGeometry> sweeping(const Laser& laser) {
  auto geometry = std::make_shared<ScanGeometry>(*test::half_circle_laser());
  const double rays = geometry->ray_count - 1;
  geometry->ray_step_s = (laser.clockwise ? -kSweep_s : kSweep_s) / rays;
  geometry->first_ray_s = kSweep_s * ((laser.clockwise ? 1.0 : 0.0) - laser.stamp);
  if (laser.upside_down) geometry->robot_from_laser.q = Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
  return geometry;
}

// Each ray from where the robot is when it is measured.
PackedScan measured(const Laser& laser, const Pose2& room_from_robot, const Track& track) {
  const auto geometry = sweeping(laser);
  PackedScan scan{geometry, std::vector<std::uint16_t>(geometry->ray_count, 0)};
  std::mt19937_64 noise(5);
  for (std::size_t ray = 0; ray < scan.ranges.size(); ++ray) {
    const Pose2 there = compose(room_from_robot, *track(geometry->ray_time_s(ray)));
    const auto upright = test::scan_from(there, test::half_circle_laser(), noise).ranges;
    scan.ranges[ray] = upright[laser.upside_down ? upright.size() - 1 - ray : ray];
  }
  return scan;
}

double distance_to_walls(double x, double y) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& wall : box_room()) {
    const double wx = wall.x1 - wall.x0, wy = wall.y1 - wall.y0;
    const double along = std::clamp(((x - wall.x0) * wx + (y - wall.y0) * wy) / (wx * wx + wy * wy), 0.0, 1.0);
    nearest = std::min(nearest, std::hypot(x - wall.x0 - along * wx, y - wall.y0 - along * wy));
  }
  return nearest;
}

// Of nine points of ten, the farthest from a wall.
double error_of(const PackedScan& scan, const Pose2& room_from_robot) {
  std::vector<double> errors;
  const double c = std::cos(room_from_robot.phi), s = std::sin(room_from_robot.phi);
  for (const auto& p : points_in_robot(scan, 0.0, 30.0))
    errors.push_back(distance_to_walls(room_from_robot.x + c * p.x - s * p.y, room_from_robot.y + s * p.x + c * p.y));
  std::sort(errors.begin(), errors.end());
  return errors.at(errors.size() * 9 / 10);
}

// Even from the first ray to the last, as a front end takes it from odometry.
SweepMotion motion_of(const PackedScan& scan, const Track& track) {
  const double first = scan.geometry->ray_time_s(0), last = scan.geometry->ray_time_s(scan.ranges.size() - 1);
  const Pose2 moved = between(*track(std::min(first, last)), *track(std::max(first, last)));
  return sweep_motion({moved.x / kSweep_s, moved.y / kSweep_s, moved.phi / kSweep_s});
}

// Stands still, then turns and drives off.
Track begins_at(double begin_s, double turn_rad_s, double speed_m_s) {
  const auto there = [=](double seconds) {
    const double turned = turn_rad_s * std::max(0.0, seconds - begin_s);
    const double driven = speed_m_s * std::max(0.0, seconds - begin_s);
    return Pose2{driven * std::cos(0.5 * turned), driven * std::sin(0.5 * turned), turned};
  };
  return [=](double seconds) { return std::optional(between(there(0.0), there(seconds))); };
}

const Pose2 kPlace{-2.0, -1.0, 0.3};

TEST(EvenOut, puts_the_points_of_uneven_motion_on_the_walls) {
  for (const Laser& laser :
       {Laser{}, Laser{true, false, 0.0}, Laser{false, true, 0.0}, Laser{false, false, 0.5}, Laser{true, true, 1.0}})
    for (const double turn_rad_s : {2.5, -2.5}) {
      const auto track = begins_at(kSweep_s * (0.5 - laser.stamp), turn_rad_s, 0.5);
      PackedScan scan = measured(laser, kPlace, track);
      scan.motion = motion_of(scan, track);
      const double before = error_of(scan, kPlace);
      ASSERT_TRUE(even_out(scan, track));
      const std::string what = (laser.clockwise ? "clockwise " : "") + std::string(laser.upside_down ? "hanging " : "");
      EXPECT_GT(before, 0.08) << what << turn_rad_s;
      EXPECT_LT(error_of(scan, kPlace), 0.03) << what << turn_rad_s;  // readings have 0.01
      const auto seen = [](const PackedScan& one) {
        return std::count_if(one.ranges.begin(), one.ranges.end(), [](auto range) { return range != 0; });
      };
      EXPECT_GT(seen(scan), 165) << what;  // rays that turned out of the scan are lost
    }
}

TEST(EvenOut, leaves_scans_of_even_or_unknown_motion_alone) {
  const auto even = [](double seconds) { return std::optional(moved({300, 0, 1700}, seconds)); };
  PackedScan scan = measured({}, kPlace, even);
  scan.motion = {300, 0, 1700};
  const auto ranges = scan.ranges;
  EXPECT_FALSE(even_out(scan, even));
  EXPECT_FALSE(even_out(scan, [](double) { return std::optional<Pose2>(); }));
  EXPECT_FALSE(even_out(scan, [](double seconds) { return std::optional(Pose2{seconds / 0.0, 0.0, 0.0}); }));
  EXPECT_EQ(scan.ranges, ranges);
}

TEST(EvenOut, does_not_believe_that_a_robot_spins) {
  PackedScan scan = measured({}, kPlace, begins_at(1.0, 0.0, 0.0));
  const auto ranges = scan.ranges;
  EXPECT_FALSE(even_out(scan, begins_at(0.0, 40.0, 0.0)));
  EXPECT_EQ(scan.ranges, ranges);
}

TEST(EvenOut, fills_no_gap_between_a_wall_and_what_stands_before_it) {
  const auto track = begins_at(0.05, 2.0, 0.0);
  PackedScan scan = measured({}, kPlace, track);
  for (std::size_t ray = 80; ray < 100; ++ray) scan.ranges[ray] = 0;                               // nothing seen
  for (std::size_t ray = 40; ray < 60; ++ray) scan.ranges[ray] = static_cast<std::uint16_t>(500);  // somebody near
  scan.motion = motion_of(scan, track);
  ASSERT_TRUE(even_out(scan, track));
  for (std::size_t ray = 86; ray < 94; ++ray) EXPECT_EQ(scan.ranges[ray], 0) << ray;
  for (std::size_t ray = 30; ray < 70; ++ray)
    EXPECT_TRUE(scan.ranges[ray] == 0 || std::abs(scan.ranges[ray] - 500) < 60 || scan.ranges[ray] > 900)
        << ray << " " << scan.ranges[ray];
}

}  // namespace
}  // namespace mapweave::laser
