#include "room.h"

#include <gtest/gtest.h>

#include <tuple>

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

TEST(SparseWallField, says_what_the_field_says_in_less_room) {
  WallField field;
  field.add(room());
  field.add({{60.0F, 45.0F, 0, 1}});  // far off, and too few for a distribution
  field.settle();
  const SparseWallField sparse(field);
  const auto& all = field.likelihood();
  EXPECT_LT(sparse.bytes(), all.bytes() / 4);
  const auto dense = sparse.likelihood().dense();
  std::size_t faces = 0;
  for (int y = all.first_y() - 3; y < all.first_y() + all.height() + 3; ++y)
    for (int x = all.first_x() - 3; x < all.first_x() + all.width() + 3; ++x) {
      ASSERT_EQ(sparse.likelihood().get(x, y), all.get(x, y)) << x << ", " << y;
      ASSERT_EQ(dense.get(x, y), all.get(x, y)) << x << ", " << y;
      const double x_m = (x + 0.5) * WallField::kResolution, y_m = (y + 0.5) * WallField::kResolution;
      for (const auto& [nx, ny] : {std::pair{1.0, 0.1}, {0.1, 1.0}, {-1.0, -0.1}, {-0.1, -1.0}}) {
        const LocalNormal *one = field.normal_at(x_m, y_m, nx, ny), *other = sparse.normal_at(x_m, y_m, nx, ny);
        ASSERT_EQ(one == nullptr, other == nullptr) << x_m << ", " << y_m;
        if (one == nullptr) continue;
        ++faces;
        ASSERT_EQ(std::tie(one->mean_x, one->mean_y, one->normal_x, one->normal_y, one->w00, one->w10, one->w11),
                  std::tie(other->mean_x, other->mean_y, other->normal_x, other->normal_y, other->w00, other->w10,
                           other->w11));
      }
    }
  EXPECT_GT(faces, 500U);
}

TEST(SparseWallField, of_nothing_says_nothing) {
  const SparseWallField sparse{WallField()};
  EXPECT_TRUE(sparse.likelihood().empty());
  EXPECT_TRUE(sparse.likelihood().dense().empty());
  EXPECT_EQ(sparse.likelihood().get(0, 0), 0);
  EXPECT_EQ(sparse.normal_at(0, 0, 0, 1), nullptr);
  EXPECT_EQ(SparseWallField().normal_at(0, 0, 0, 1), nullptr);
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
