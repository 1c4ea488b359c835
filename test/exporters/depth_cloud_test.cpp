#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/exporters/depth_cloud.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapweave::exporters {
namespace {

// A wall of 2 m x 1 m at x = 3.007, in steps of `step_m`.
std::vector<ColouredPoint> wall(float step_m, std::uint32_t rgb = 0x336699) {
  std::vector<ColouredPoint> points;
  for (float y = -1.0F; y < 1.0F; y += step_m)
    for (float z = 0.0F; z < 1.0F; z += step_m) points.push_back({{3.007F, y, z}, rgb});
  return points;
}

TEST(DepthCloud, keeps_a_wall_where_it_stands_one_point_in_each_cube) {
  DepthCloud cloud({0.05, 100.0});
  cloud.add(wall(0.01F));
  const auto points = cloud.points();
  EXPECT_NEAR(static_cast<double>(points.size()), 40.0 * 20.0, 70.0);
  for (const auto& [point, rgb] : points) {
    EXPECT_NEAR(point.x(), 3.007F, 0.05F / 500);
    EXPECT_EQ(rgb, 0x336699U);
  }
}

TEST(DepthCloud, holds_means_of_places_and_colours) {
  DepthCloud cloud({0.1, 100.0});
  cloud.add({{{-0.02F, 0.01F, 0.01F}, 0x100020}, {{-0.06F, 0.05F, 0.03F}, 0x300000}});
  const auto points = cloud.points();
  ASSERT_EQ(points.size(), 1U);
  EXPECT_LT((points[0].point - Eigen::Vector3f(-0.04F, 0.03F, 0.02F)).norm(), 2e-4F);
  EXPECT_EQ(points[0].rgb, 0x200010U);
}

TEST(DepthCloud, is_the_same_in_any_order) {
  auto points = wall(0.013F);
  for (std::size_t i = 0; i < points.size(); ++i)
    points[i].rgb = static_cast<std::uint32_t>(i * 2654435761U) & 0xffffff;
  DepthCloud one({0.05, 100.0}), other({0.05, 100.0});
  one.add(points);
  std::reverse(points.begin(), points.end());
  other.add(points);
  EXPECT_EQ(ply_bytes(one.points()), ply_bytes(other.points()));
}

TEST(DepthCloud, doubles_its_cubes_where_memory_is_short_and_keeps_the_means) {
  DepthCloud cloud({0.01, 1.0});
  for (float metres = 0.0F; metres < 4.0F; metres += 1.0F) {
    auto points = wall(0.01F);
    for (auto& point : points) point.point.x() += metres;
    cloud.add(points);
    EXPECT_LE(cloud.size(), cloud.most_voxels());
  }
  EXPECT_GT(cloud.voxel_m(), 0.01);
  EXPECT_LE(cloud.voxel_m(), 0.04);
  for (const auto& [point, rgb] : cloud.points()) {
    EXPECT_NEAR(point.x() - std::floor(point.x()), 0.007F, 0.0003F) << "its own wall, not the middle of the cube";
    EXPECT_EQ(rgb, 0x336699U);
  }
}

TEST(DepthCloud, bears_more_points_in_a_cube_than_its_sums_could_hold) {
  DepthCloud cloud({0.1, 0.001});  // eight cubes
  cloud.add(std::vector<ColouredPoint>(300000, {{0.09F, 0.09F, 0.09F}, 0xfffefd}));
  for (int i = 0; i < 12; ++i)
    cloud.add({{{1.0F + static_cast<float>(i), 0.0F, 0.0F}, 0}});  // which makes it coarser, again and again
  EXPECT_LE(cloud.size(), cloud.most_voxels());
  const auto points = cloud.points();
  EXPECT_NEAR(points.front().point.y(), 0.09F, 0.01F);
  EXPECT_GT(points.front().rgb, 0xf00000U);
}

TEST(DepthCloud, refuses_what_is_no_place) {
  DepthCloud cloud;
  EXPECT_THROW(cloud.add({{{std::numeric_limits<float>::quiet_NaN(), 0.0F, 0.0F}, 0}}), ContractViolation);
  cloud.add({{{1e30F, 0.0F, 0.0F}, 0}});
  EXPECT_EQ(cloud.size(), 0U);
}

TEST(PlyBytes, hold_points_and_colours_as_others_read_them) {
  const std::string bytes = ply_bytes({{{1.5F, -2.0F, 0.25F}, 0x0a0b0c}, {{0.0F, 0.0F, 1.0F}, 0xff0000}});
  const std::string end = "end_header\n";
  const std::size_t data = bytes.find(end) + end.size();
  EXPECT_EQ(bytes.substr(0, 4), "ply\n");
  EXPECT_NE(bytes.find("\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\n"), std::string::npos);
  ASSERT_EQ(bytes.size() - data, 2U * 15U);
  float place[3];
  std::copy_n(bytes.data() + data, sizeof place, reinterpret_cast<char*>(place));
  EXPECT_EQ(Eigen::Vector3f(place[0], place[1], place[2]), Eigen::Vector3f(1.5F, -2.0F, 0.25F));
  EXPECT_EQ(bytes.substr(data + 12, 3), "\x0a\x0b\x0c");
  EXPECT_EQ(bytes.substr(data + 27, 3), std::string("\xff\0\0", 3));
}

}  // namespace
}  // namespace mapweave::exporters
