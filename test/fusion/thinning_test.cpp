#include <mapweave/fusion/thinning.h>

#include <gmock/gmock.h>
#include <mapweave/maps/map_update.h>
#include <support/pose_matchers.h>
#include <support/simulated_maps.h>

#include <algorithm>
#include <set>

namespace mapweave::fusion {
namespace {

using test::IsNear;

FusionResult fused(std::vector<Map> maps, std::vector<MergedMaps> merged = {},
                   std::set<std::pair<MapId, MapId>> refused = {}) {
  WorkerPool pool(2);
  Memo memo;
  const auto progress = make_silent_progress();
  FusionInput input;
  input.maps = std::move(maps);
  input.by = TierId("cloud");
  input.merged = std::move(merged);
  input.refused = std::move(refused);
  return fuse(input, {}, memo, pool, *progress);
}

std::size_t bytes_of(const Map& map) {
  MapUpdate update = difference({}, map);
  update.origin = {TierId("north"), map.id};
  update.sequence = 1;
  return encode(update).size();
}

// Three robots of one apartment; an edge has merged the first two.
struct Edge {
  std::vector<Map> maps;
  FusionResult merged;
  ThinnedMaps sent;
  Edge() {
    simulation::TeamOptions options;
    options.robots = 3;
    options.shared = 0.6;
    const auto team = simulation::make_apartment({}, options);
    for (const auto& robot : team.robots) maps.push_back(test::mapped(robot, team.laser));
    merged = fused({maps[0], maps[1]});
    sent = thinned(merged.components.at(0), {&maps[0], &maps[1]}, {});
  }
};

const Edge& edge() {
  static const Edge shared;
  return shared;
}

const Pose2 pose_in(const Map& map, const NodeId& id) { return planar(map.nodes.find(id)->map_from_node); }

TEST(Thinning, keeps_what_shows_each_place_and_says_what_it_leaves_out) {
  const ThinnedMaps& sent = edge().sent;
  ASSERT_EQ(edge().merged.components.size(), 1U);
  ASSERT_EQ(sent.maps.size(), 2U);
  EXPECT_LT(sent.kept, sent.scans / 3);
  EXPECT_LT(sent.walls_left_out, 0.03);
  std::size_t before = 0, after = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    const Map &whole = edge().maps[i], &thin = sent.maps[i];
    EXPECT_EQ(thin.nodes.size(), whole.nodes.size()) << "every pose is there";
    EXPECT_EQ(thin.submaps.size(), whole.submaps.size());
    before += bytes_of(whole);
    after += bytes_of(thin);
  }
  EXPECT_LT(after, 0.5 * before);
  std::printf("%zu of %zu scans, %zu of %zu bytes, %.3f of the walls left out\n", sent.kept, sent.scans, after, before,
              sent.walls_left_out);
}

TEST(Thinning, sums_constraints_up_so_that_nothing_moves) {
  const FusionResult again = fused({edge().sent.maps[0], edge().sent.maps[1]}, {*edge().sent.merged});
  ASSERT_EQ(again.components.size(), 1U);
  EXPECT_TRUE(again.reopened.empty());
  const Map &before = edge().merged.components[0].map, &after = again.components[0].map;
  ASSERT_EQ(after.nodes.size(), before.nodes.size());
  double most_m = 0.0;
  for (const auto& [id, node] : before.nodes) {
    const Pose2 apart = between(planar(node.map_from_node), pose_in(after, id));
    most_m = std::max(most_m, std::hypot(apart.x, apart.y));
  }
  EXPECT_LT(most_m, 0.02);
  std::set<NodeId> held;
  for (const auto& entry : after.constraints) held.insert({entry.first.from, entry.first.to});
  EXPECT_EQ(held.size(), after.nodes.size()) << "constraints hold every node";
}

TEST(Thinning, merges_with_others_as_whole_maps_do) {
  const FusionResult whole = fused(edge().maps),
                     thin = fused({edge().sent.maps[0], edge().sent.maps[1], edge().maps[2]}, {*edge().sent.merged});
  ASSERT_EQ(whole.components.size(), 1U);
  ASSERT_EQ(thin.components.size(), 1U);
  for (const MapId& id : whole.components[0].members)
    EXPECT_THAT(planar(*thin.components[0].team_from_map.find(id)),
                IsNear(planar(*whole.components[0].team_from_map.find(id)), 0.05, 0.01))
        << id.str();
  ASSERT_EQ(thin.verdicts.size(), 3U);
  EXPECT_EQ(thin.verdicts[0].decision, Decision::accepted);
}

TEST(Thinning, is_the_same_each_time) {
  const ThinnedMaps again = thinned(edge().merged.components[0], {&edge().maps[0], &edge().maps[1]}, {});
  EXPECT_EQ(encode(*again.merged), encode(*edge().sent.merged));
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(content_hash(again.maps[i]), content_hash(edge().sent.maps[i]));
    EXPECT_EQ(bytes_of(again.maps[i]), bytes_of(edge().sent.maps[i]));
  }
}

TEST(Thinning, of_a_robot_alone_leaves_out_what_it_showed_before) {
  const FusionResult alone = fused({edge().maps[2]});
  const ThinnedMaps sent = thinned(alone.components.at(0), {&edge().maps[2]}, {});
  EXPECT_FALSE(sent.merged);
  EXPECT_LT(sent.kept, sent.scans / 2);
  for (const auto& [id, node] : edge().maps[2].nodes)
    EXPECT_THAT(pose_in(sent.maps[0], id), IsNear(planar(node.map_from_node), 1e-6, 1e-6));
}

TEST(Thinning, takes_lasers_in_the_plane_alone) {
  EXPECT_TRUE(can_be_thinned(edge().maps[0]));
  EXPECT_FALSE(can_be_thinned(Map{}));
  Map tilted = edge().maps[0];
  tilted.nodes.begin()->second.map_from_node.t.z() = 0.1;
  EXPECT_FALSE(can_be_thinned(tilted));
}

TEST(MergedBefore, is_taken_apart_where_it_is_refused) {
  const MapId first = edge().maps[0].id, second = edge().maps[1].id;
  const FusionResult apart =
      fused({edge().sent.maps[0], edge().sent.maps[1]}, {*edge().sent.merged}, {{first, second}});
  EXPECT_EQ(apart.components.size(), 2U);
  ASSERT_EQ(apart.reopened.size(), 1U);
  EXPECT_THAT(apart.reopened[0], testing::ElementsAre(first, second));
}

TEST(MergedBefore, that_names_what_is_not_here_is_left_out) {
  MergedMaps merged = *edge().sent.merged;
  merged.matches.front().from.index = 1000;
  EXPECT_EQ(fused({edge().maps[0], edge().maps[1]}, {merged}).components.size(), 1U) << "merged by what is here";
  merged = *edge().sent.merged;
  merged.constraints.front().id.from.index = 100000;
  EXPECT_EQ(fused({edge().maps[0], edge().maps[1]}, {merged}).components.size(), 1U);
  EXPECT_EQ(fused({edge().maps[0]}, {*edge().sent.merged}).components.size(), 1U);
}

}  // namespace
}  // namespace mapweave::fusion
