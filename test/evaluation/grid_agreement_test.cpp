#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/evaluation/grid_agreement.h>

#include <string>

namespace mapweave::evaluation {
namespace {

// '#' wall, '.' free, ' ' unknown; the first row is the highest y.
OccupancyGrid drawn(const std::vector<std::string>& rows, double resolution_m = 1.0, double origin_x_m = 0.0,
                    double origin_y_m = 0.0) {
  OccupancyGrid grid;
  grid.resolution_m = resolution_m;
  grid.origin_x_m = origin_x_m;
  grid.origin_y_m = origin_y_m;
  grid.rows = static_cast<std::int32_t>(rows.size());
  grid.columns = static_cast<std::int32_t>(rows.front().size());
  for (auto row = rows.rbegin(); row != rows.rend(); ++row)
    for (const char c : *row) grid.log_odds.push_back(static_cast<std::int16_t>(c == '#' ? 200 : c == '.' ? -150 : 0));
  return grid;
}

const std::vector<std::string> kRoom = {"########",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "#......#",  //
                                        "########"};

TEST(GridAgreement, of_a_grid_with_itself_is_complete) {
  const auto result = grid_agreement(drawn(kRoom), drawn(kRoom));
  EXPECT_DOUBLE_EQ(result.overlap, 1.0);
  EXPECT_DOUBLE_EQ(result.agreement, 1.0);
  EXPECT_DOUBLE_EQ(result.conflict, 0.0);
  EXPECT_DOUBLE_EQ(result.wall_iou, 1.0);
  EXPECT_DOUBLE_EQ(result.common_m2, 40.0);
}

TEST(GridAgreement, counts_what_both_know_whatever_the_origins) {
  // b is the right half of the room, and a column more.
  const auto a = drawn(kRoom);
  const auto b = drawn({"####.", "...#.", "...#.", "...#.", "####."}, 1.0, 4.0, 0.0);
  const auto result = grid_agreement(a, b);
  EXPECT_DOUBLE_EQ(result.known_a_m2, 40.0);
  EXPECT_DOUBLE_EQ(result.known_b_m2, 25.0);
  EXPECT_DOUBLE_EQ(result.common_m2, 20.0);
  EXPECT_DOUBLE_EQ(result.overlap, 20.0 / 25.0);
  EXPECT_DOUBLE_EQ(result.agreement, 1.0);
  EXPECT_DOUBLE_EQ(result.conflict, 0.0);
  EXPECT_DOUBLE_EQ(result.wall_iou,
                   0.5 * (13.0 + 11.0) /
                       (22.0 + 11.0 - 12.0));  // a cell of a's walls beyond b is next to one of b's, above and below
}

TEST(GridAgreement, forgives_a_wall_one_cell_off_but_not_two) {
  const auto one_off = grid_agreement(drawn({"#.....", "#.....", "#....."}), drawn({".#....", ".#....", ".#...."}));
  EXPECT_DOUBLE_EQ(one_off.conflict, 0.0);
  EXPECT_DOUBLE_EQ(one_off.wall_iou, 1.0);
  EXPECT_DOUBLE_EQ(one_off.agreement, 12.0 / 18.0);
  const auto two_off = grid_agreement(drawn({"#.....", "#.....", "#....."}), drawn({"..#...", "..#...", "..#..."}));
  EXPECT_DOUBLE_EQ(two_off.conflict, 1.0);
  EXPECT_DOUBLE_EQ(two_off.wall_iou, 0.0);
  EXPECT_DOUBLE_EQ(grid_agreement(drawn({"#..", "#.."}), drawn({".#.", ".#."}), {0}).conflict, 1.0);
}

TEST(GridAgreement, conflict_is_that_of_the_worse_side) {
  // a's two walls: one is b's too, one stands where b saw free floor. b's only wall is a's.
  const auto a = drawn({"#......#"}), b = drawn({"#......."});
  EXPECT_DOUBLE_EQ(grid_agreement(a, b).conflict, 0.5);
  EXPECT_DOUBLE_EQ(grid_agreement(b, a).conflict, 0.5);
}

TEST(GridAgreement, is_the_same_from_either_side) {
  const auto a = drawn({"#..# ", "#.#..", "  .#."}), b = drawn({"##...", "..#..", "#...#"}, 1.0, 1.0, 1.0);
  const auto there = grid_agreement(a, b), back = grid_agreement(b, a);
  EXPECT_DOUBLE_EQ(there.overlap, back.overlap);
  EXPECT_DOUBLE_EQ(there.agreement, back.agreement);
  EXPECT_DOUBLE_EQ(there.conflict, back.conflict);
  EXPECT_DOUBLE_EQ(there.wall_iou, back.wall_iou);
}

TEST(GridAgreement, pools_the_finer_grid_into_the_coarser) {
  std::vector<std::string> fine;  // the room at half the cell size
  for (const auto& row : kRoom)
    for (int twice = 0; twice < 2; ++twice) {
      fine.emplace_back();
      for (const char c : row) fine.back().append(2, c);
    }
  for (const auto& [a, b] : {std::pair(drawn(kRoom), drawn(fine, 0.5)), std::pair(drawn(fine, 0.5), drawn(kRoom))}) {
    const auto result = grid_agreement(a, b);
    EXPECT_DOUBLE_EQ(result.resolution_m, 1.0);
    EXPECT_DOUBLE_EQ(result.overlap, 1.0);
    EXPECT_DOUBLE_EQ(result.agreement, 1.0);
    EXPECT_DOUBLE_EQ(result.wall_iou, 1.0);
  }
}

TEST(GridAgreement, of_grids_with_a_shifted_lattice_is_not_lost) {
  const auto result = grid_agreement(drawn(kRoom), drawn(kRoom, 1.0, 0.3, -0.4));
  EXPECT_DOUBLE_EQ(result.agreement, 1.0);
  EXPECT_DOUBLE_EQ(result.overlap, 1.0);
}

TEST(GridAgreement, of_places_apart_is_nothing) {
  const auto result = grid_agreement(drawn(kRoom), drawn(kRoom, 1.0, 100.0, 0.0));
  EXPECT_DOUBLE_EQ(result.overlap, 0.0);
  EXPECT_DOUBLE_EQ(result.agreement, 0.0);
  EXPECT_DOUBLE_EQ(result.conflict, 0.0);
  EXPECT_DOUBLE_EQ(result.wall_iou, 0.0);
}

TEST(GridAgreement, refuses_grids_that_know_nothing) {
  EXPECT_THROW(grid_agreement(drawn(kRoom), drawn({"  ", "  "})), Error);
  EXPECT_THROW(grid_agreement(drawn(kRoom), OccupancyGrid{}), ContractViolation);
}

TEST(MovedGrid, lies_where_another_frame_has_it) {
  OccupancyGrid grid;
  grid.resolution_m = 0.1;
  grid.columns = 30;
  grid.rows = 20;
  grid.log_odds.assign(600, -100);
  for (std::size_t column = 0; column < 30; ++column) grid.log_odds[column] = 100;  // a wall at its lower side
  const OccupancyGrid turned = moved(grid, Pose2(5.0, 1.0, M_PI / 2));
  EXPECT_EQ(turned.columns, 20);
  EXPECT_EQ(turned.rows, 30);
  EXPECT_NEAR(turned.origin_x_m, 3.0, 1e-9);
  EXPECT_NEAR(turned.origin_y_m, 1.0, 1e-9);
  EXPECT_EQ(turned.at(19, 10), 100);  // now at its right one
  EXPECT_EQ(turned.at(18, 10), -100);
  const GridAgreement same = grid_agreement(grid, moved(turned, inverse(Pose2(5.0, 1.0, M_PI / 2))));
  EXPECT_EQ(same.agreement, 1.0);
  EXPECT_EQ(same.overlap, 1.0);
}

}  // namespace
}  // namespace mapweave::evaluation
