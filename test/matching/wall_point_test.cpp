#include <gtest/gtest.h>
#include <mapweave/matching/wall_point.h>

#include <algorithm>
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
    scan.ranges.push_back(static_cast<std::uint16_t>(
        1000 * (2.0 / std::max(std::abs(std::cos(angle)), std::abs(std::sin(angle))) + noise)));
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

// Things of 4 cm, such as the legs of tables, with a point every centimetre.
std::vector<WallPoint> row_of_legs(bool from_the_left) {
  std::vector<WallPoint> points;
  for (int leg = -5; leg <= 5; ++leg)
    for (int i = -2; i <= 2; ++i)
      points.push_back({0.5F * static_cast<float>(leg) + 0.01F * static_cast<float>(i), 2.0F, 0.0F, -1.0F});
  if (from_the_left) std::reverse(points.begin(), points.end());
  return points;
}
double middle_of(const std::vector<WallPoint>& points) {
  double sum = 0.0;
  for (const auto& p : points) sum += p.x;
  return sum / static_cast<double>(points.size());
}

TEST(ThinnedEvenly, shifts_nothing_to_the_side_that_the_laser_saw_first) {
  for (const bool from_the_left : {false, true}) {
    const auto points = thinned_evenly(row_of_legs(from_the_left), 0.05, 180);
    EXPECT_EQ(points.size(), 11U);
    EXPECT_NEAR(middle_of(points), 0.0, 1e-6);
    EXPECT_NEAR(std::abs(middle_of(thinned(row_of_legs(from_the_left), 0.05, 180))), 0.02, 1e-6)
        << "as the other one does";
  }
}

TEST(ThinnedEvenly, keeps_points_apart_and_no_more_than_asked_for) {
  const auto points = thinned_evenly(wall_points(square_room(0.0)), 0.1, 1000);
  EXPECT_GT(points.size(), 60U);
  for (std::size_t i = 1; i < points.size(); ++i)
    EXPECT_GT(std::hypot(points[i].x - points[i - 1].x, points[i].y - points[i - 1].y), 0.04);
  EXPECT_EQ(thinned_evenly(wall_points(square_room(0.0)), 0.1, 20).size(), 20U);
}

}  // namespace
}  // namespace mapweave::matching
