#include "room.h"

#include <gtest/gtest.h>

namespace mapweave::matching {
namespace {

TEST(WallField, is_brightest_on_walls_and_dark_away_from_them) {
  WallField field;
  field.add(room());
  field.settle();
  EXPECT_EQ(field.likelihood().get(cell_of(3.0, 20.0), cell_of(0.0, 20.0)), 255);
  EXPECT_EQ(field.likelihood().get(cell_of(2.0, 20.0), cell_of(2.5, 20.0)), 0);
  EXPECT_EQ(field.likelihood().get(1000000, 1000000), 0);
}

TEST(WallField, knows_where_a_wall_faces) {
  WallField field;
  field.add(room());
  field.settle();
  const LocalNormal* wall = field.normal_at(3.0, 0.01, 0.1, 0.9);
  ASSERT_NE(wall, nullptr);
  EXPECT_NEAR(wall->normal_y, 1.0, 0.01);
  EXPECT_NEAR(wall->mean_y, 0.0, 0.005);
  EXPECT_GT(wall->flatness, 0.8F);
  EXPECT_EQ(field.normal_at(3.0, 0.01, 0.0, -1.0), nullptr) << "nobody saw its back";
  EXPECT_EQ(field.normal_at(2.0, 2.5, 0, 1), nullptr);
  EXPECT_EQ(WallField().normal_at(0, 0, 0, 1), nullptr);
}

TEST(WallField, is_the_same_whether_points_come_at_once_or_one_by_one) {
  const auto points = room(0.1F);
  WallField at_once, one_by_one;
  at_once.add(points);
  at_once.settle();
  for (const auto& p : points) {
    one_by_one.add({p});
    one_by_one.settle();
  }
  const auto a = at_once.walls(1.0F), b = one_by_one.walls(1.0F);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_FLOAT_EQ(a[i].x, b[i].x);
    EXPECT_FLOAT_EQ(a[i].normal_x, b[i].normal_x);
  }
}

TEST(WallField, keeps_the_faces_of_a_thin_wall_apart) {
  WallField field;
  std::vector<WallPoint> faces;
  for (int i = 0; i < 100; ++i) {
    const float x = 0.02F * static_cast<float>(i);
    faces.push_back({x, 0.96F, 0, -1});
    faces.push_back({x, 1.04F, 0, 1});
  }
  field.add(faces);
  field.settle();
  const LocalNormal* near_face = field.normal_at(1.0, 1.0, 0.2, -1.0);
  const LocalNormal* far_face = field.normal_at(1.0, 1.0, 0.2, 1.0);
  ASSERT_TRUE(near_face != nullptr && far_face != nullptr);
  EXPECT_NEAR(near_face->mean_y, 0.96, 1e-3);
  EXPECT_NEAR(far_face->mean_y, 1.04, 1e-3);
  std::size_t up = 0, down = 0;
  for (const auto& wall : field.walls(2.0F)) (wall.normal_y > 0 ? up : down) += 1;
  EXPECT_GE(up, 19U);
  EXPECT_GE(down, 19U);
}

TEST(WallField, takes_points_on_all_sides_of_its_origin) {
  WallField field;
  field.add({{-40.0F, -40.0F, 1, 0}});
  field.add({{40.0F, 40.0F, 1, 0}});
  EXPECT_EQ(field.likelihood().get(cell_of(-40.0, 20.0), cell_of(-40.0, 20.0)), 255);
  EXPECT_EQ(field.likelihood().get(cell_of(40.0, 20.0), cell_of(40.0, 20.0)), 255);
}

}  // namespace
}  // namespace mapweave::matching
