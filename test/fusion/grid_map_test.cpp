#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/fusion/compose_grid.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/fusion/grid_map.h>
#include <support/pose_matchers.h>
#include <support/simulated_maps.h>

#include <algorithm>

namespace mapweave::fusion {
namespace {

using test::IsNear;

OccupancyGrid apartment_grid(const simulation::SimulatedTeam& team, std::size_t robot) {
  WorkerPool pool(1);
  return compose_grid(test::truth_map(team.robots[robot], team.laser), {}, pool);
}

TEST(GridMap, is_drawn_again_as_it_was) {
  simulation::TeamOptions options;
  options.robots = 1;
  options.length_m = 20.0;
  const OccupancyGrid grid = apartment_grid(simulation::make_apartment({}, options), 0);
  WorkerPool pool(1);
  const Map map = map_of_grid(MapId("office"), grid);
  const OccupancyGrid again = compose_grid(map, {}, pool);
  const int dx = static_cast<int>(std::lround((again.origin_x_m - grid.origin_x_m) / 0.05)),
            dy = static_cast<int>(std::lround((again.origin_y_m - grid.origin_y_m) / 0.05));
  std::size_t differing = 0;
  for (int row = 0; row < grid.rows; ++row)
    for (int column = 0; column < grid.columns; ++column)
      differing += !again.inside(column - dx, row - dy)
                       ? grid.at(column, row) != 0
                       : (again.at(column - dx, row - dy) > 0) != (grid.at(column, row) > 0);
  EXPECT_EQ(differing, 0U);
}

TEST(GridMap, joins_with_a_robots_map_of_the_same_place) {
  simulation::TeamOptions options;
  options.shared = 1.0;
  const auto team = simulation::make_apartment({}, options);
  const Map robot = test::mapped(team.robots[1], team.laser);
  const Pose2 grid_from_robot =
      between(team.robots[0].steps.front().world_from_robot, team.robots[1].steps.front().world_from_robot);
  // Whichever comes first by its name.
  for (const char* name : {"a_floor", "z_floor"}) {
    const Map grid = map_of_grid(MapId(name), apartment_grid(team, 0));
    WorkerPool pool(2);
    Memo memo;
    const auto progress = make_silent_progress();
    const auto result = fuse({{grid, robot}, {}, TierId("cloud")}, {}, memo, pool, *progress);
    ASSERT_EQ(result.verdicts.size(), 1U);
    const Verdict& verdict = result.verdicts[0];
    EXPECT_EQ(verdict.kind, "grid");
    ASSERT_EQ(verdict.decision, Decision::accepted) << to_text(verdict.reason);
    EXPECT_THAT(planar(verdict.alignment->a_from_b.pose),
                IsNear(verdict.a == grid.id ? grid_from_robot : inverse(grid_from_robot), 0.2, 0.05));
  }
}

TEST(GridMap, gives_back_its_grid_though_bent) {
  simulation::TeamOptions options;
  options.robots = 1;
  options.length_m = 20.0;
  const OccupancyGrid grid = apartment_grid(simulation::make_apartment({}, options), 0);
  Map map = map_of_grid(MapId("office"), grid);
  for (auto it = std::next(map.nodes.begin()); it != map.nodes.end(); ++it) {
    Node node = it->second;
    node.map_from_node = spatial(compose(planar(node.map_from_node), Pose2(0.1, -0.2, 0.03)));
    map.nodes.set(it->first, node);
  }
  const OccupancyGrid again = grid_of_map(map);
  const int dx = static_cast<int>(std::lround((again.origin_x_m - grid.origin_x_m) / grid.resolution_m)),
            dy = static_cast<int>(std::lround((again.origin_y_m - grid.origin_y_m) / grid.resolution_m));
  std::size_t differing = 0;
  for (int row = 0; row < grid.rows; ++row)
    for (int column = 0; column < grid.columns; ++column)
      differing += grid.at(column, row) != (again.inside(column - dx, row - dy) ? again.at(column - dx, row - dy) : 0);
  EXPECT_EQ(differing, 0U);
}

TEST(GridMap, refuses_a_grid_that_knows_nothing) {
  OccupancyGrid grid;
  grid.columns = grid.rows = 10;
  grid.log_odds.assign(100, OccupancyGrid::kUnknown);
  EXPECT_THROW(map_of_grid(MapId("void"), grid), Error);
}

TEST(GridMap, of_a_kilometre_in_coarse_cells_is_drawn_as_coarse_as_it_is) {
  OccupancyGrid grid;
  grid.resolution_m = 1.0;
  grid.columns = grid.rows = 600;
  grid.log_odds.assign(600 * 600, -100);
  for (int i = 0; i < 600; ++i) grid.log_odds[static_cast<std::size_t>(i * 600 + i)] = 100;
  WorkerPool pool(1);
  const OccupancyGrid again = compose_grid(map_of_grid(MapId("site"), grid), {}, pool);
  EXPECT_EQ(again.resolution_m, 1.0);
  EXPECT_LE(again.columns, 603);
  EXPECT_EQ(std::count_if(again.log_odds.begin(), again.log_odds.end(), [](std::int16_t v) { return v > 0; }), 600);
}

TEST(GridMap, refuses_cells_too_coarse_for_walls) {
  OccupancyGrid grid;
  grid.resolution_m = 500.0;
  grid.columns = grid.rows = 2;
  grid.log_odds.assign(4, 100);
  EXPECT_THROW(map_of_grid(MapId("site"), grid), Error);
}

}  // namespace
}  // namespace mapweave::fusion
