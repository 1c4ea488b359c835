#include "room.h"

#include <gtest/gtest.h>

namespace mapweave::matching {
namespace {

TEST(WallField, is_brightest_on_walls_and_dark_away_from_them) {
  WallField field;
  field.add(room());
  EXPECT_EQ(field.likelihood().get(cell_of(3.0, 20.0), cell_of(0.0, 20.0)), 255);
  EXPECT_EQ(field.likelihood().get(cell_of(2.0, 20.0), cell_of(2.5, 20.0)), 0);
  EXPECT_EQ(field.likelihood().get(1000000, 1000000), 0);
}

TEST(WallField, knows_which_way_a_wall_faces) {
  WallField field;
  field.add(room());
  const LocalNormal* wall = field.normal_at(3.0, 0.01);
  ASSERT_NE(wall, nullptr);
  EXPECT_NEAR(std::abs(wall->normal_y), 1.0, 0.01);
  EXPECT_NEAR(wall->mean_y, 0.0, 0.005);
  EXPECT_GT(wall->flatness, 0.8F);
  EXPECT_EQ(field.normal_at(2.0, 2.5), nullptr);
  EXPECT_EQ(WallField().normal_at(0, 0), nullptr);
}

TEST(WallField, is_the_same_whether_points_come_at_once_or_one_by_one) {
  const auto points = room(0.1F);
  WallField at_once, one_by_one;
  at_once.add(points);
  for (const auto& p : points) one_by_one.add({p});
  const auto a = at_once.wall_cells(1.0F), b = one_by_one.wall_cells(1.0F);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_FLOAT_EQ(a[i].mean.x, b[i].mean.x);
    EXPECT_EQ(a[i].count, b[i].count);
  }
}

TEST(WallField, takes_points_on_all_sides_of_its_origin) {
  WallField field;
  field.add({{-40.0F, -40.0F}});
  field.add({{40.0F, 40.0F}});
  EXPECT_EQ(field.likelihood().get(cell_of(-40.0, 20.0), cell_of(-40.0, 20.0)), 255);
  EXPECT_EQ(field.likelihood().get(cell_of(40.0, 20.0), cell_of(40.0, 20.0)), 255);
}

}  // namespace
}  // namespace mapweave::matching
