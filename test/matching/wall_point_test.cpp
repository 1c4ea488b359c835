#include <gtest/gtest.h>
#include <mapweave/matching/wall_point.h>

#include <cmath>

namespace mapweave::matching {
namespace {

// A laser in the middle of a square room 4 m wide, `offset` ahead of the robot's middle.
PackedScan square_room(double offset) {
  auto geometry = std::make_shared<ScanGeometry>();
  geometry->ray_count = 360;
  geometry->angle_step_rad = M_PI / 180;
  geometry->max_range_m = 30.0;
  geometry->robot_from_laser.t = {offset, 0, 0};
  PackedScan scan{geometry, {}};
  for (int ray = 0; ray < 360; ++ray) {
    const double angle = ray * M_PI / 180;
    const double noise = 0.004 * ((ray * 7919) % 5 - 2);
    scan.ranges.push_back(
        static_cast<std::uint16_t>(1000 * (2.0 / std::max(std::abs(std::cos(angle)), std::abs(std::sin(angle))) + noise)));
  }
  return scan;
}

TEST(WallPoints, face_the_laser_as_their_wall_does) {
  for (const auto& p : wall_points(square_room(0.5))) {
    const double x = p.x - 0.5, y = p.y;
    EXPECT_NEAR(std::hypot(p.normal_x, p.normal_y), 1.0, 1e-5);
    EXPECT_LT(p.normal_x * x + p.normal_y * y, 0.0);
    if (std::abs(std::abs(x) - std::abs(y)) < 0.2) continue;  // a corner faces both ways
    const bool on_x = std::abs(x) > std::abs(y);
    EXPECT_GT(std::abs(on_x ? p.normal_x : p.normal_y), 0.8) << x << ' ' << y;
  }
}

TEST(WallPoints, that_stand_alone_face_the_laser) {
  auto geometry = std::make_shared<ScanGeometry>(*square_room(0.0).geometry);
  PackedScan scan{geometry, std::vector<std::uint16_t>(360, 0)};
  scan.ranges[90] = 3000;
  const auto points = wall_points(scan);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_NEAR(points[0].y, 3.0, 1e-5);
  EXPECT_NEAR(points[0].normal_y, -1.0, 1e-5);
}

TEST(WallPoints, leave_out_what_is_too_near_or_too_far) {
  EXPECT_EQ(wall_points(square_room(0.0), 0.0, 1.5).size(), 0U);
  EXPECT_EQ(wall_points(square_room(0.0), 3.0).size(), 0U);
  EXPECT_EQ(wall_points(square_room(0.0)).size(), 360U);
}

TEST(WallPoints, turn_with_the_frame) {
  const auto turned = placed({1.0, 2.0, M_PI / 2}, {{1, 0, -1, 0}});
  EXPECT_NEAR(turned[0].x, 1.0, 1e-6);
  EXPECT_NEAR(turned[0].y, 3.0, 1e-6);
  EXPECT_NEAR(turned[0].normal_y, -1.0, 1e-6);
}

}  // namespace
}  // namespace mapweave::matching
