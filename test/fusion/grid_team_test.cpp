// Teams of map_server grids: what fuse() makes of them, and of pictures that are no maps.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/fusion/raster_doubt.h>
#include <mapweave/maps/reasons.h>
#include <support/drawn_grids.h>
#include <support/pose_matchers.h>

namespace mapweave::fusion {
namespace {

using simulation::Point2;
using test::drawn_grid;
using test::DrawnGridOptions;

simulation::FloorPlan office(std::uint64_t seed) {
  simulation::ApartmentOptions options;
  options.width_m = 30.0;
  options.height_m = 18.0;
  return simulation::make_apartment_plan(options, seed);
}

FusionResult fused(std::vector<Map> maps, std::set<Hash> vetoed = {}, int threads = 1) {
  WorkerPool pool(static_cast<std::size_t>(threads));
  Memo memo;
  const auto progress = make_silent_progress();
  return fuse({std::move(maps), std::move(vetoed), TierId("cloud")}, {}, memo, pool, *progress);
}

// Where the team has a place of the building that a member saw, by the tile that holds it.
Point2 in_team(const Component& component, const Map& own, const DrawnGridOptions& drawn, Point2 in_plan) {
  const Point2 p = test::in_grid(drawn, in_plan);
  const double* known = component.scales.find(own.id);
  const double scale = known != nullptr ? *known : 1.0;
  for (const auto& [id, node] : own.nodes) {
    const auto& tile = std::get<OccupancyGrid>(*node.payload);
    const double x = p.x - node.map_from_node.t.x(), y = p.y - node.map_from_node.t.y();
    if (x < 0.0 || y < 0.0 || x >= tile.columns * tile.resolution_m || y >= tile.rows * tile.resolution_m) continue;
    const Pose2 there = compose(planar(component.map.nodes.find(id)->map_from_node), Pose2(scale * x, scale * y, 0.0));
    return {there.x, there.y};
  }
  ADD_FAILURE() << "no tile at " << p.x << ", " << p.y;
  return {1e9, 1e9};
}

struct Halves {
  DrawnGridOptions west, east;
  Halves() {
    west.seen = {-1.0, -1.0, 20.0, 30.0};
    east.seen = {9.0, -1.0, 40.0, 30.0};
    east.grid_from_plan = {-7.0, 40.0, 1.9};
  }
};

TEST(GridTeam, is_one_map_though_one_grid_is_scaled_and_bent) {
  for (const char* name : {"a", "z"}) {  // whichever keeps its scale
    Halves halves;
    halves.east.resolution_m = 0.07;
    halves.east.scale = 1.06;
    halves.east.bend_m = 0.2;
    const Map west = map_of_grid(MapId("m"), drawn_grid(office(1), halves.west));
    const Map east = map_of_grid(MapId(name), drawn_grid(office(1), halves.east));
    const FusionResult result = fused({west, east});
    ASSERT_EQ(result.components.size(), 1U) << to_text(result.verdicts[0].reason);
    const Component& team = result.components[0];
    const Map& first = west.id < east.id ? west : east;
    EXPECT_FALSE(team.scales.contains(first.id));
    const MapId& second = west.id < east.id ? east.id : west.id;
    ASSERT_TRUE(team.scales.contains(second));
    EXPECT_NEAR(*team.scales.find(second), second == east.id ? 1.0 / 1.06 : 1.06, 0.02);
    double mean = 0.0;
    const std::vector<Point2> places{{12.0, 4.0}, {14.0, 9.0}, {16.0, 14.0}, {18.0, 7.0}};
    for (const Point2& place : places) {
      const Point2 one = in_team(team, west, halves.west, place), other = in_team(team, east, halves.east, place);
      mean += std::hypot(one.x - other.x, one.y - other.y) / static_cast<double>(places.size());
    }
    EXPECT_LT(mean, 0.3) << name;
  }
}

TEST(GridTeam, chains_grids_that_share_nothing) {
  DrawnGridOptions west, middle, east;
  west.seen = {-1.0, -1.0, 14.5, 30.0};
  middle.seen = {2.5, -1.0, 27.5, 30.0};
  east.seen = {15.5, -1.0, 40.0, 30.0};
  const Map a = map_of_grid(MapId("a"), drawn_grid(office(1), west)),
            b = map_of_grid(MapId("b"), drawn_grid(office(1), east)),
            c = map_of_grid(MapId("c"), drawn_grid(office(1), middle));
  const FusionResult result = fused({a, b, c});
  ASSERT_EQ(result.components.size(), 1U);
  const Point2 at_west = in_team(result.components[0], a, west, {8.0, 9.0}),
               at_east = in_team(result.components[0], b, east, {22.0, 9.0});
  EXPECT_NEAR(std::hypot(at_east.x - at_west.x, at_east.y - at_west.y), 14.0, 0.4);
}

TEST(GridTeam, leaves_a_mirror_image_apart_whatever_it_is_called) {
  for (const std::uint64_t seed : {1, 2}) {
    const OccupancyGrid grid = drawn_grid(office(seed));
    for (const auto& [plain, mirror] : {std::pair("a", "b"), std::pair("o", "m")}) {
      const FusionResult result =
          fused({map_of_grid(MapId(plain), grid), map_of_grid(MapId(mirror), test::flipped(grid))});
      EXPECT_EQ(result.components.size(), 2U) << seed << plain;
      const Reason reason = result.verdicts[0].reason;
      EXPECT_THAT(reason, testing::AnyOf(Reason::contradiction, Reason::ambiguous)) << to_text(reason);
    }
  }
}

TEST(GridTeam, keeps_a_grid_that_is_apart_as_it_was) {
  const Map grid = map_of_grid(MapId("a"), drawn_grid(office(1))),
            other = map_of_grid(MapId("b"), drawn_grid(office(11)));
  const FusionResult result = fused({grid, other});
  ASSERT_EQ(result.components.size(), 2U);
  for (const Component& component : result.components)
    EXPECT_EQ(content_hash(component.map), content_hash(component.members[0] == grid.id ? grid : other));
}

TEST(GridTeam, does_not_join_what_is_vetoed) {
  const Halves halves;
  const Map west = map_of_grid(MapId("a"), drawn_grid(office(1), halves.west)),
            east = map_of_grid(MapId("b"), drawn_grid(office(1), halves.east));
  const FusionResult joined = fused({west, east});
  ASSERT_EQ(joined.components.size(), 1U);
  ASSERT_EQ(joined.verdicts[0].witnesses.size(), 1U);
  const FusionResult apart = fused({west, east}, {joined.verdicts[0].witnesses[0]});
  EXPECT_EQ(apart.components.size(), 2U);
  EXPECT_EQ(apart.verdicts[0].reason, Reason::vetoed);
}

TEST(GridTeam, is_the_same_for_any_order_of_maps_and_number_of_threads) {
  const Halves halves;
  const Map west = map_of_grid(MapId("a"), drawn_grid(office(1), halves.west)),
            east = map_of_grid(MapId("b"), drawn_grid(office(1), halves.east));
  const FusionResult one = fused({west, east}), other = fused({east, west}, {}, 3);
  ASSERT_EQ(one.components.size(), 1U);
  ASSERT_EQ(other.components.size(), 1U);
  EXPECT_EQ(one.verdicts[0].probability, other.verdicts[0].probability);
  for (const auto& [id, node] : one.components[0].map.nodes)
    EXPECT_THAT(planar(other.components[0].map.nodes.find(id)->map_from_node),
                test::IsNear(planar(node.map_from_node), 0.0, 0.0));
}

TEST(GridTeam, reports_how_merged_grids_lie_and_what_speaks_for_it) {
  Halves halves;
  halves.east.scale = 1.06;
  const Map west = map_of_grid(MapId("a"), drawn_grid(office(1), halves.west)),
            east = map_of_grid(MapId("b"), drawn_grid(office(1), halves.east));
  const FusionResult result = fused({west, east});
  ASSERT_EQ(result.components.size(), 1U);
  const Verdict& verdict = result.verdicts[0];
  ASSERT_FALSE(verdict.hypotheses.empty());
  const PairHypothesis& best = verdict.hypotheses.front();
  EXPECT_EQ(best.sense, Sense::grids);
  EXPECT_NEAR(best.a_from_b.scale, 1.0 / 1.06, 0.02);
  const Point2 in_a = test::in_grid(halves.west, {14.5, 9.0}), in_b = test::in_grid(halves.east, {14.5, 9.0});
  const Eigen::Vector3d there = transformed(Eigen::Vector3d(in_b.x, in_b.y, 0.0), best.a_from_b);
  EXPECT_LT(std::hypot(there.x() - in_a.x, there.y() - in_a.y), 0.3);
  EXPECT_GT(best.coinciding_m, 20.0);
  EXPECT_GT(best.support_m, 10.0);
  EXPECT_GT(best.log_odds, 3.0);
  ASSERT_TRUE(verdict.in_one_map);
  EXPECT_TRUE(verdict.in_one_map->through.empty());
  EXPECT_NEAR(verdict.in_one_map->a_from_b.scale, 1.0 / 1.06, 0.02);
}

TEST(GridTeam, reports_what_spoke_against_grids_that_stay_apart) {
  const OccupancyGrid grid = drawn_grid(office(1));
  const FusionResult result = fused({map_of_grid(MapId("a"), grid), map_of_grid(MapId("b"), test::flipped(grid))});
  ASSERT_EQ(result.components.size(), 2U);
  const Verdict& verdict = result.verdicts[0];
  EXPECT_FALSE(verdict.in_one_map);
  EXPECT_FALSE(verdict.detail.empty());
  ASSERT_FALSE(verdict.hypotheses.empty());
  for (const PairHypothesis& hypothesis : verdict.hypotheses) {
    EXPECT_EQ(hypothesis.sense, Sense::grids);
    for (const PairHypothesis::ContradictedWall& place : hypothesis.contradictions) EXPECT_GE(place.length_m, 0.6);
  }
}

TEST(GridTeam, knows_rasters_that_are_no_maps) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    EXPECT_EQ(doubt_of_raster(drawn_grid(office(seed))), "") << seed;
    EXPECT_NE(doubt_of_raster(test::page_of_text(seed)).find("page of text"), std::string::npos) << seed;
    EXPECT_NE(doubt_of_raster(test::photograph(seed)), "") << seed;
  }
  DrawnGridOptions coarse;
  coarse.resolution_m = 0.2;
  EXPECT_EQ(doubt_of_raster(drawn_grid(office(1), coarse)), "");
  EXPECT_NE(doubt_of_raster(test::blank_grid(300, 200, 300)).find("no free space"), std::string::npos);
  EXPECT_NE(doubt_of_raster(test::blank_grid(300, 200, -300)).find("0.0 m of wall"), std::string::npos);
}

TEST(GridTeam, gives_a_reason_for_text_and_photographs) {
  const Map building = map_of_grid(MapId("a"), drawn_grid(office(1)));
  for (const auto& [picture, reason] :
       {std::pair(test::page_of_text(1), Reason::ambiguous), std::pair(test::photograph(1), Reason::unobservable)}) {
    const FusionResult result = fused({building, map_of_grid(MapId("b"), picture)});
    ASSERT_EQ(result.components.size(), 2U);
    const Verdict& verdict = result.verdicts[0];
    EXPECT_EQ(verdict.reason, reason) << to_text(verdict.reason);
    EXPECT_EQ(in_words(verdict.reason), reason == Reason::ambiguous ? "they fit together in more than one way"
                                                                    : "they could slide along each other");
    EXPECT_LT(verdict.probability, 0.7);
  }
}

TEST(GridTeam, says_that_a_grid_of_free_space_alone_shows_no_place) {
  const Map building = map_of_grid(MapId("a"), drawn_grid(office(1)));
  const FusionResult result = fused({building, map_of_grid(MapId("b"), test::blank_grid(300, 200, -300))});
  ASSERT_EQ(result.components.size(), 2U);
  EXPECT_EQ(result.verdicts[0].reason, Reason::unobservable);
  EXPECT_EQ(result.verdicts[0].decision, Decision::deferred);
}

TEST(GridTeam, refuses_a_grid_that_is_all_unknown_with_a_remedy) {
  try {
    map_of_grid(MapId("hall"), test::blank_grid(300, 200, OccupancyGrid::kUnknown));
    FAIL() << "a map of nothing";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    const std::string text = error.what();
    EXPECT_NE(text.find("every cell of the grid is unknown"), std::string::npos) << text;
    EXPECT_NE(text.find("check its thresholds"), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace mapweave::fusion
