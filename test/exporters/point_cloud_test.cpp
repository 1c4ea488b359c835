#include "small_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/exporters/point_cloud.h>

#include <cstring>
#include <set>
#include <sstream>

namespace mapweave::exporters {
namespace {

using test::add_pose;
using test::cross_scan;
using test::node_id;

struct Point {
  float x, y, z;
  std::uint32_t rgb;
};
static_assert(sizeof(Point) == 16);

// As PCL reads it: the header's lines in any order, then the points.
std::vector<Point> points_of(const std::string& bytes) {
  std::istringstream lines(bytes);
  std::string line, word, fields, sizes, types;
  std::size_t width = 0, height = 0, points = 0;
  while (std::getline(lines, line) && line != "DATA binary") {
    std::istringstream words(line);
    words >> word;
    if (word == "FIELDS") fields = line;
    if (word == "SIZE") sizes = line;
    if (word == "TYPE") types = line;
    if (word == "WIDTH") words >> width;
    if (word == "HEIGHT") words >> height;
    if (word == "POINTS") words >> points;
  }
  EXPECT_EQ(fields, "FIELDS x y z rgb");
  EXPECT_EQ(sizes, "SIZE 4 4 4 4");
  EXPECT_EQ(types, "TYPE F F F F");
  EXPECT_EQ(width * height, points);
  const auto begin = static_cast<std::size_t>(lines.tellg());
  EXPECT_EQ(bytes.size() - begin, points * sizeof(Point));
  std::vector<Point> result(points);
  if (points > 0) std::memcpy(result.data(), bytes.data() + begin, points * sizeof(Point));
  return result;
}

TEST(PcdBytes, hold_the_ends_of_rays_in_the_maps_frame) {
  Map map;
  add_pose(map, node_id("alpha", 0), 1, spatial(Pose2(10.0, 5.0, M_PI / 2)), cross_scan({2.0, 1.0, 0.0, 3.0}));
  const auto points = points_of(pcd_bytes(map));
  ASSERT_EQ(points.size(), 3u);
  std::set<std::pair<int, int>> rounded;  // ahead of a robot that looks to +y is +y
  for (const auto& point : points) {
    rounded.emplace(static_cast<int>(std::lround(point.x * 10)), static_cast<int>(std::lround(point.y * 10)));
    EXPECT_FLOAT_EQ(point.z, 0.0f);
    EXPECT_EQ(point.rgb, 0x0072b2u);
  }
  EXPECT_THAT(rounded, testing::ElementsAre(std::pair(90, 50), std::pair(100, 70), std::pair(130, 50)));
}

TEST(PcdBytes, keep_one_point_in_each_cube_the_mean_in_the_colour_of_the_first) {
  Map map;
  add_pose(map, node_id("alpha", 0), 1, {}, cross_scan({2.51, 0.0, 0.0, 0.0}));
  add_pose(map, node_id("alpha", 1), 2, {}, cross_scan({2.53, 0.0, 0.0, 0.0}));
  add_pose(map, node_id("beta", 0), 3, {}, cross_scan({2.54, 7.01, 0.0, 0.0}));
  const auto points = points_of(pcd_bytes(map, {0.1, 30.0}));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_NEAR(points[0].y, 7.01, 1e-3);
  EXPECT_EQ(points[0].rgb, 0xd55e00u);
  EXPECT_NEAR(points[1].x, (2.51 + 2.53 + 2.54) / 3.0, 1e-3);
  EXPECT_EQ(points[1].rgb, 0x0072b2u);
}

TEST(PcdBytes, leave_out_long_rays_and_nodes_without_scan) {
  Map map;
  add_pose(map, node_id("alpha", 0), 1, {}, cross_scan({31.0, 29.0, 0.0, 0.0}));
  add_pose(map, node_id("alpha", 1), 2, {});
  EXPECT_EQ(points_of(pcd_bytes(map)).size(), 1u);
}

TEST(PcdBytes, take_the_wall_cells_of_a_served_grid) {
  Map map;
  add_pose(map, node_id("floor", 0), 0, spatial(Pose2(100.0, 0.0, 0.0)),
           std::make_shared<const Payload>(test::drawn_grid({"#.", " #"}, 0.5, 1.0, 2.0)));
  const auto points = points_of(pcd_bytes(map));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_FLOAT_EQ(points[0].x, 101.25f);
  EXPECT_FLOAT_EQ(points[0].y, 2.75f);
  EXPECT_FLOAT_EQ(points[1].x, 101.75f);
  EXPECT_FLOAT_EQ(points[1].y, 2.25f);
}

TEST(PcdBytes, hold_landmarks_after_walls_in_their_own_colours) {
  Map map;
  const Pose3 map_from_keyframe{{10.0, 5.0, 0.5},
                                Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()))};
  auto camera = std::make_shared<CameraGeometry>();
  camera->width = 640;
  camera->height = 480;
  camera->fx = camera->fy = 500.0;
  add_pose(map, node_id("alpha", 0), 1, map_from_keyframe,
           std::make_shared<const Payload>(KeyframeFeatures{camera, {}, {}}));
  for (std::uint32_t i = 0; i < 2; ++i) {
    Landmark landmark;
    landmark.id = {node_id("alpha", 0).session, i};
    landmark.anchor = node_id("alpha", 0);
    landmark.point_units = landmark_units({2.0, 0.01 * i, 1.25});
    landmark.colour = {0x12, static_cast<std::uint8_t>(i), 0xf0};
    map.landmarks.set(landmark.id, landmark);
  }
  const auto landmarks = points_of(pcd_bytes(landmark_cloud(map)));
  ASSERT_EQ(landmarks.size(), 2u) << "landmarks are not thinned";
  EXPECT_FLOAT_EQ(landmarks[0].x, 10.0f);
  EXPECT_FLOAT_EQ(landmarks[0].y, 7.0f);
  EXPECT_FLOAT_EQ(landmarks[0].z, 1.75f);
  EXPECT_EQ(landmarks[0].rgb, 0x1200f0u);
  EXPECT_FLOAT_EQ(landmarks[1].x, 9.99f);
  EXPECT_EQ(landmarks[1].rgb, 0x1201f0u);

  add_pose(map, node_id("beta", 0), 2, {}, cross_scan({2.0, 0.0, 0.0, 0.0}));
  const auto points = points_of(pcd_bytes(map));
  ASSERT_EQ(points.size(), 3u);
  EXPECT_FLOAT_EQ(points[0].x, 2.0f);
  EXPECT_EQ(points[2].rgb, 0x1201f0u);

  map.nodes.erase(node_id("alpha", 0));
  EXPECT_THROW(landmark_cloud(map), ContractViolation);
}

TEST(PcdBytes, of_an_empty_map_are_a_cloud_without_points) { EXPECT_TRUE(points_of(pcd_bytes(Map{})).empty()); }

TEST(PcdBytes, are_the_same_each_time) {
  Map map;
  for (std::uint32_t i = 0; i < 200; ++i)
    add_pose(map, node_id("alpha", i), i, spatial(Pose2(0.1 * i, 0.03 * i, 0.2 * i)), cross_scan({2.0, 3.0, 4.0, 5.0}));
  EXPECT_EQ(pcd_bytes(map), pcd_bytes(map));
}

TEST(PcdBytes, need_voxels_with_a_size) { EXPECT_THROW(pcd_bytes(Map{}, {0.0, 30.0}), ContractViolation); }

}  // namespace
}  // namespace mapweave::exporters
