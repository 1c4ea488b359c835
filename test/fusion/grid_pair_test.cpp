#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/fusion/grid_pair.h>
#include <mapweave/graph/pose_graph.h>
#include <support/drawn_grids.h>
#include <support/pose_matchers.h>

namespace mapweave::fusion {
namespace {

using simulation::Box;
using simulation::Point2;
using test::drawn_grid;
using test::DrawnGridOptions;

simulation::FloorPlan office(std::uint64_t seed) {
  simulation::ApartmentOptions options;
  options.width_m = 30.0;
  options.height_m = 18.0;
  return simulation::make_apartment_plan(options, seed);
}

constexpr Box kWest{-1.0, -1.0, 20.0, 30.0}, kEast{9.0, -1.0, 40.0, 30.0};
const Point2 kShared{14.5, 9.0};  // the middle of both

// How far the alignment puts a place of the building from where it is.
double off_m(const GridPairResult& result, const DrawnGridOptions& a, const DrawnGridOptions& b, Point2 place) {
  const Point2 in_a = test::in_grid(a, place), in_b = test::in_grid(b, place);
  const Pose2 found = compose(planar(result.alignment->a_from_b.pose), Pose2(in_b.x, in_b.y, 0.0));
  return std::hypot(found.x - in_a.x, found.y - in_a.y);
}

TEST(GridPair, finds_a_grid_that_is_turned_scaled_bent_and_of_another_resolution) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    DrawnGridOptions west, east;
    west.seen = kWest;
    east.seen = kEast;
    east.resolution_m = 0.07;
    east.scale = 1.06;
    east.grid_from_plan = {-7.0, 40.0, 1.9};
    east.bend_m = 0.3;
    const auto result = align_grids(drawn_grid(office(seed), west), drawn_grid(office(seed), east));
    ASSERT_EQ(result.reason, Reason::none) << seed << ": " << result.note;
    EXPECT_LT(off_m(result, west, east, kShared), 0.5) << seed;
    EXPECT_NEAR(result.hypotheses.front().a_from_b.scale, 1.0 / 1.06, 0.02) << seed;
    EXPECT_GT(result.grid_constraints.size(), 4U);
  }
}

TEST(GridPair, says_the_same_from_either_side_and_wherever_a_grid_lies) {
  DrawnGridOptions west, east, moved;
  west.seen = kWest;
  east.seen = moved.seen = kEast;
  moved.grid_from_plan = {100.0, -30.0, -0.7};
  const OccupancyGrid a = drawn_grid(office(1), west), b = drawn_grid(office(1), east);
  const auto result = align_grids(a, b), reversed = align_grids(b, a),
             elsewhere = align_grids(a, drawn_grid(office(1), moved));
  ASSERT_EQ(result.reason, Reason::none) << result.note;
  EXPECT_EQ(reversed.reason, Reason::none);
  EXPECT_EQ(reversed.probability, result.probability);
  EXPECT_THAT(planar(reversed.alignment->a_from_b.pose),
              test::IsNear(inverse(planar(result.alignment->a_from_b.pose)), 1e-6, 1e-9));
  EXPECT_EQ(elsewhere.reason, Reason::none) << elsewhere.note;
  EXPECT_LT(off_m(elsewhere, west, moved, kShared), 0.2);
}

TEST(GridPair, refuses_mirror_images) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const OccupancyGrid grid = drawn_grid(office(seed));
    const auto result = align_grids(grid, test::flipped(grid));
    EXPECT_THAT(result.reason, testing::AnyOf(Reason::contradiction, Reason::ambiguous)) << seed;
    EXPECT_FALSE(result.note.empty());
  }
}

TEST(GridPair, refuses_other_buildings) {
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    EXPECT_NE(align_grids(drawn_grid(office(seed)), drawn_grid(office(seed + 10))).reason, Reason::none) << seed;
    EXPECT_NE(align_grids(drawn_grid(office(seed)), drawn_grid(simulation::make_hall_plan({}, seed))).reason,
              Reason::none)
        << seed;
  }
}

TEST(GridPair, refuses_rooms_that_are_all_alike) {
  const auto rooms = simulation::make_repeated_rooms_plan({}, 4);
  DrawnGridOptions west, east;
  west.seen = {-1.0, -1.0, 16.0, 30.0};
  east.seen = {8.0, -1.0, 40.0, 30.0};
  const auto result = align_grids(drawn_grid(rooms, west), drawn_grid(rooms, east));
  EXPECT_EQ(result.reason, Reason::ambiguous) << result.note;
}

TEST(GridPair, constraints_bend_the_joint_graph_so_that_walls_coincide) {
  DrawnGridOptions west, east;
  west.seen = kWest;
  east.seen = kEast;
  east.bend_m = 0.25;
  const OccupancyGrid grid_a = drawn_grid(office(2), west), grid_b = drawn_grid(office(2), east);
  const auto result = align_grids(grid_a, grid_b);
  ASSERT_EQ(result.reason, Reason::none) << result.note;
  const Map a = map_of_grid(MapId("a"), grid_a), b = map_of_grid(MapId("b"), grid_b);
  const auto constraints = constraints_of(result.grid_constraints, a, b, Hash{});
  ASSERT_GT(constraints.size(), 4U);
  Map team = a;
  const Pose2 a_from_b = planar(result.alignment->a_from_b.pose);
  for (const auto& [id, node] : b.nodes) {
    Node placed = node;
    placed.map_from_node = spatial(compose(a_from_b, planar(node.map_from_node)));
    team.nodes.set(id, placed);
  }
  for (const auto& [id, constraint] : b.constraints) team.constraints.set(id, constraint);
  for (const auto& constraint : constraints) team.constraints.set(constraint.id, constraint);
  const Map rigid = team;
  EXPECT_LT(graph::optimise(team).rejected.size(), constraints.size() / 4);

  // Places that both saw, in the tiles that hold them.
  const auto in_team = [](const Map& map, const Map& own, Point2 p) {
    for (const auto& [id, node] : own.nodes) {
      const auto& tile = std::get<OccupancyGrid>(*node.payload);
      const double x = p.x - node.map_from_node.t.x(), y = p.y - node.map_from_node.t.y();
      if (x < 0.0 || y < 0.0 || x >= tile.columns * tile.resolution_m || y >= tile.rows * tile.resolution_m) continue;
      const Pose2 there = compose(planar(map.nodes.find(id)->map_from_node), Pose2(x, y, 0.0));
      return Point2{there.x, there.y};
    }
    return Point2{1e9, 1e9};
  };
  double before = 0.0, after = 0.0;
  for (const double x : {11.0, 13.0, 15.0, 17.0, 19.0})
    for (const double y : {3.0, 6.0, 9.0, 12.0, 15.0}) {
      const Point2 pa = test::in_grid(west, {x, y}), pb = test::in_grid(east, {x, y});
      const auto distance = [&](const Map& map) {
        const Point2 qa = in_team(map, a, pa), qb = in_team(map, b, pb);
        return std::hypot(qa.x - qb.x, qa.y - qb.y);
      };
      before += distance(rigid) / 25.0;
      after += distance(team) / 25.0;
    }
  EXPECT_GT(before, 0.15);
  EXPECT_LT(after, 0.8 * before);
}

TEST(GridPair, refuses_text_and_photographs) {
  const OccupancyGrid building = drawn_grid(office(1));
  for (const unsigned seed : {1U, 2U}) {
    const auto reason = [&](const OccupancyGrid& a, const OccupancyGrid& b) { return align_grids(a, b).reason; };
    // Lines of text fit in many ways or nowhere; what fits of a photograph's speckles does so anywhere.
    const auto is_of_text = testing::AnyOf(Reason::contradiction, Reason::ambiguous);
    EXPECT_THAT(reason(building, test::page_of_text(seed)), is_of_text) << seed;
    EXPECT_THAT(reason(test::page_of_text(seed), test::page_of_text(seed + 3)), is_of_text) << seed;
    EXPECT_EQ(reason(building, test::photograph(seed)), Reason::unobservable) << seed;
    EXPECT_EQ(reason(test::photograph(seed), test::photograph(seed + 3)), Reason::unobservable) << seed;
    EXPECT_EQ(reason(test::photograph(seed), test::page_of_text(seed)), Reason::unobservable) << seed;
    EXPECT_THAT(align_grids(building, test::photograph(seed)).note, testing::HasSubstr("walls beside free space"))
        << seed;
  }
}

TEST(GridPair, says_that_grids_without_walls_show_no_place) {
  const OccupancyGrid building = drawn_grid(office(1));
  OccupancyGrid single = test::blank_grid(1, 1, 300);
  for (const OccupancyGrid& nothing : {OccupancyGrid{}, test::blank_grid(300, 200, 0), test::blank_grid(300, 200, -300),
                                       test::blank_grid(300, 200, 300), single}) {
    for (const auto& result :
         {align_grids(building, nothing), align_grids(nothing, building), align_grids(nothing, nothing)}) {
      EXPECT_EQ(result.reason, Reason::unobservable);
      EXPECT_FALSE(result.alignment);
      EXPECT_NE(result.note.find("walls beside free space"), std::string::npos);
    }
  }
}

TEST(GridPair, refuses_a_grid_of_one_room) {
  DrawnGridOptions room;
  room.seen = {0.0, 0.0, 4.5, 4.5};
  EXPECT_NE(align_grids(drawn_grid(office(1)), drawn_grid(office(5), room)).reason, Reason::none);
}

TEST(GridPair, works_on_no_more_than_2048_cells_across) {
  OccupancyGrid huge = test::blank_grid(6000, 5000, -300);
  for (int i = 0; i < 5000; ++i) huge.log_odds[static_cast<std::size_t>(i) * 6000 + static_cast<std::size_t>(i)] = 300;
  const auto walls = matching::walls_of(huge);
  EXPECT_LE(walls.columns, 2048);
  EXPECT_NEAR(walls.columns * walls.cell_m, 300.0, 1.0);
  EXPECT_LT(walls.faces.size(), 3U * 2048U);
}

}  // namespace
}  // namespace mapweave::fusion
