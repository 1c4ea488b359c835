#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/matching/corner_proposals.h>

#include <algorithm>
#include <cmath>

namespace mapweave::matching {
namespace {

// Rectangles of floor in unknown space; walls are the unknown cells beside floor. Two corners of the grid are known,
// so that no wall lies at the edge of what is known, where the side that it shows is not.
struct Floor {
  double x0, y0, x1, y1;
};

OccupancyGrid grid_of(const std::vector<Floor>& floors, const Pose2& grid_from_floor = {}) {
  OccupancyGrid grid;
  grid.resolution_m = 0.05;
  grid.columns = grid.rows = 800;
  grid.origin_x_m = grid.origin_y_m = -20.0;
  grid.log_odds.assign(static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows),
                       OccupancyGrid::kUnknown);
  const Pose2 floor_from_grid = inverse(grid_from_floor);
  const auto is_floor = [&](double grid_x, double grid_y) {
    const Pose2 at = compose(floor_from_grid, Pose2(grid_x, grid_y, 0.0));
    return std::any_of(floors.begin(), floors.end(),
                       [&](const Floor& f) { return at.x > f.x0 && at.x < f.x1 && at.y > f.y0 && at.y < f.y1; });
  };
  for (int row = 0; row < grid.rows; ++row)
    for (int column = 0; column < grid.columns; ++column) {
      const double x = grid.origin_x_m + (column + 0.5) * grid.resolution_m,
                   y = grid.origin_y_m + (row + 0.5) * grid.resolution_m;
      auto& cell = grid.log_odds[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.columns) +
                                 static_cast<std::size_t>(column)];
      if (is_floor(x, y)) {
        cell = -100;
        continue;
      }
      for (int turn = 0; turn < 8; ++turn)
        if (is_floor(x + 0.08 * std::cos(turn * M_PI / 4.0), y + 0.08 * std::sin(turn * M_PI / 4.0))) cell = 100;
    }
  grid.log_odds.front() = grid.log_odds.back() = -100;
  return grid;
}

// Four rooms of different sizes along a corridor; no two alike.
const std::vector<Floor> kFlat = {{0, 0, 12, 1.6},    {0.5, 1.8, 3.5, 5},    {4, 1.8, 8.2, 6.1},
                                  {9, 1.8, 11.5, 4},  {2, -4.3, 6.4, -0.2},  {1, 1.5, 1.9, 1.9},
                                  {5, 1.5, 5.9, 1.9}, {9.5, 1.5, 10.4, 1.9}, {3, -0.3, 3.9, 0.1}};

std::vector<Floor> between_x(double x0, double x1) {
  std::vector<Floor> part;
  for (Floor f : kFlat)
    if (f.x1 > x0 && f.x0 < x1) part.push_back({std::max(f.x0, x0), f.y0, std::min(f.x1, x1), f.y1});
  return part;
}

TEST(WallCorners, are_found_where_two_walls_meet_with_the_side_they_show) {
  // An L: five corners of the room, one that sticks out into it.
  const std::vector<std::pair<double, double>> known = {{0, 0}, {6, 0}, {6, 2.5}, {3, 2.5}, {3, 5}, {0, 5}};
  const auto corners = corners_of(walls_of(grid_of({{0, 0, 6, 2.5}, {0, 0, 3, 5}})));
  ASSERT_EQ(corners.size(), known.size());
  for (const auto& [x, y] : known) {
    const auto corner = std::find_if(corners.begin(), corners.end(), [x = x, y = y](const WallCorner& c) {
      return std::hypot(c.at.x - x, c.at.y - y) < 0.15;
    });
    ASSERT_NE(corner, corners.end()) << x << ", " << y;
    EXPECT_EQ(corner->is_outer, x == 3 && y == 2.5);
    EXPECT_NEAR(corner->opening_rad, M_PI / 2.0, 0.2);
    const double free_side = std::atan2(y < 1.0 ? 1.0 : -1.0, x < 1.0 ? 1.0 : -1.0);
    const double expected = corner->is_outer ? -0.75 * M_PI : free_side;
    EXPECT_NEAR(wrap_angle(corner->direction_rad - expected), 0.0, 0.15) << x << ", " << y;
  }
}

TEST(CornerProposals, put_a_part_of_a_flat_where_it_lies_in_another_part) {
  const GridWalls left = walls_of(grid_of(between_x(-1, 8.5)));
  for (const Pose2& moved : {Pose2(3, -2, 0.4), Pose2(-4, 1, -1.9), Pose2(0, 0, M_PI)}) {
    const auto proposals = propose_by_corners(left, walls_of(grid_of(between_x(3.5, 12), moved)), 6, 0.5);
    // The corridor fits by half a turn as well, over all of its length: whole maps decide between the two.
    ASSERT_GE(proposals.size(), 2U);
    EXPECT_TRUE(std::any_of(proposals.begin(), proposals.begin() + 2, [&](const CornerProposal& proposal) {
      const Pose2 off = compose(proposal.a_from_b, moved);
      return std::hypot(off.x, off.y) < 0.15 && std::abs(off.phi) < 0.02;
    })) << moved.phi;
  }
}

TEST(CornerProposals, think_less_of_a_mirror_image) {
  const GridWalls flat = walls_of(grid_of(kFlat));
  const auto right = propose_by_corners(flat, flat, 6, 0.5), wrong = propose_by_corners(flat, mirrored(flat), 6, 0.5);
  ASSERT_FALSE(right.empty());
  EXPECT_LT(wrong.empty() ? 0.0 : wrong.front().score_m, 0.6 * right.front().score_m);
}

TEST(CornerProposals, are_distinct_sorted_and_no_more_than_wanted) {
  const GridWalls flat = walls_of(grid_of(kFlat));
  const auto proposals = propose_by_corners(flat, flat, 3, 0.5);
  EXPECT_LE(proposals.size(), 3U);
  for (std::size_t i = 1; i < proposals.size(); ++i) EXPECT_GE(proposals[i - 1].score_m, proposals[i].score_m);
}

TEST(CornerProposals, are_none_where_there_are_no_walls_or_no_corners) {
  const GridWalls flat = walls_of(grid_of(kFlat));
  EXPECT_TRUE(propose_by_corners(flat, GridWalls{}, 6, 0.5).empty());
  EXPECT_TRUE(propose_by_corners(GridWalls{}, flat, 6, 0.5).empty());
  // A bare corridor whose ends are out of the grid.
  EXPECT_TRUE(propose_by_corners(flat, walls_of(grid_of({{-30, 0, 30, 1.6}})), 6, 0.5).empty());
}

}  // namespace
}  // namespace mapweave::matching
