#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/maps/map_update.h>
#include <support/pose_matchers.h>
#include <support/random_map.h>
#include <support/simulated_maps.h>

namespace mapweave::fusion {
namespace {

using test::IsNear;

FusionResult fused(std::vector<Map> maps, int threads = 1, Memo* memo = nullptr, std::set<Hash> vetoed = {}) {
  WorkerPool pool(threads);
  Memo own;
  const auto progress = make_silent_progress();
  return fuse({std::move(maps), std::move(vetoed), TierId("cloud")}, {}, memo != nullptr ? *memo : own, pool,
              *progress);
}

// Two robots of one apartment that share rooms: their maps, and the truth.
struct Apartment {
  simulation::SimulatedTeam team;
  std::vector<Map> maps;
  Pose2 first_from_second;
  explicit Apartment(double shared = 0.6, int robots = 2) {
    simulation::TeamOptions options;
    options.robots = robots;
    options.shared = shared;
    team = simulation::make_apartment({}, options);
    for (const auto& robot : team.robots) maps.push_back(test::mapped(robot, team.laser));
    first_from_second =
        between(team.robots[0].steps.front().world_from_robot, team.robots[1].steps.front().world_from_robot);
  }
};

const Apartment& apartment() {
  static const Apartment shared;
  return shared;
}

std::string bytes_of(const Component& component) {
  MapUpdate update = difference({}, component.map);
  update.origin = {TierId("cloud"), component.map.id};
  update.sequence = 1;
  return encode(update);
}

TEST(Fuse, joins_two_robots_of_one_apartment_within_centimetres) {
  const auto result = fused(apartment().maps);
  ASSERT_EQ(result.verdicts.size(), 1U);
  EXPECT_EQ(result.verdicts[0].decision, Decision::accepted) << to_text(result.verdicts[0].reason);
  ASSERT_EQ(result.components.size(), 1U);
  const Component& team = result.components[0];
  EXPECT_THAT(planar(*team.team_from_map.find(MapId("robot0"))), IsNear(Pose2{}, 1e-6, 1e-6));
  EXPECT_THAT(planar(*team.team_from_map.find(MapId("robot1"))), IsNear(apartment().first_from_second, 0.08, 0.02));
  EXPECT_THAT(planar(result.verdicts[0].alignment->a_from_b.pose), IsNear(apartment().first_from_second, 0.25, 0.04));
  EXPECT_EQ(team.map.nodes.size(), apartment().maps[0].nodes.size() + apartment().maps[1].nodes.size());
  EXPECT_GE(result.verdicts[0].witnesses.size(), 2U);
  EXPECT_LT(result.verdicts[0].conflict, 0.05);
}

TEST(Fuse, leaves_strangers_apart_and_says_why) {
  const auto team = simulation::make_two_strangers();
  std::vector<Map> maps;
  for (const auto& robot : team.robots) maps.push_back(test::mapped(robot, team.laser));
  const auto result = fused(maps);
  ASSERT_EQ(result.verdicts.size(), 1U);
  EXPECT_NE(result.verdicts[0].decision, Decision::accepted);
  EXPECT_NE(result.verdicts[0].reason, Reason::none);
  EXPECT_EQ(result.components.size(), 2U);
}

TEST(Fuse, leaves_maps_of_keyframes_alone_apart_and_whole) {
  std::vector<Map> maps = {test::RandomMaps(1).keyframe_map("alpha", 30), test::RandomMaps(1).keyframe_map("beta", 30)};
  const auto result = fused(maps);
  ASSERT_EQ(result.components.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const Map& map = result.components[i].map;
    EXPECT_EQ(content_hash(map), content_hash(maps[i]));
    const MapUpdate update = difference(maps[i], map);
    EXPECT_TRUE(update.landmarks.empty() && update.changed_landmarks.empty() && update.removed_landmarks.empty());
  }
}

TEST(Fuse, gives_the_same_bytes_for_any_order_threads_and_memo) {
  const auto forward = fused(apartment().maps, 1);
  Memo memo;
  const auto backward = fused({apartment().maps[1], apartment().maps[0]}, 3, &memo);
  EXPECT_EQ(bytes_of(forward.components[0]), bytes_of(backward.components[0]));
  ASSERT_FALSE(memo.empty());
  const std::size_t judged = memo.size();
  const auto remembered = fused(apartment().maps, 2, &memo);
  EXPECT_EQ(memo.size(), judged);
  EXPECT_EQ(bytes_of(forward.components[0]), bytes_of(remembered.components[0]));
  ASSERT_EQ(forward.judgements.size(), remembered.judgements.size());
}

TEST(Fuse, undoes_a_merge_whose_judgements_are_vetoed) {
  const auto joined = fused(apartment().maps);
  std::set<Hash> vetoed;
  for (const auto& judgement : joined.judgements) vetoed.insert(judgement.id);
  const auto apart = fused(apartment().maps, 1, nullptr, vetoed);
  EXPECT_EQ(apart.components.size(), 2U);
  EXPECT_NE(apart.verdicts[0].decision, Decision::accepted);
}

TEST(Fuse, keeps_content_as_it_is) {
  const auto result = fused(apartment().maps);
  for (const auto& map : apartment().maps)
    for (const auto& [id, submap] : map.submaps) {
      const Submap* kept = result.components[0].map.submaps.find(id);
      ASSERT_NE(kept, nullptr);
      EXPECT_EQ(kept->content, submap.content);
    }
}

TEST(Fuse, passes_single_and_empty_teams_through) {
  const auto one = fused({apartment().maps[0]});
  ASSERT_EQ(one.components.size(), 1U);
  EXPECT_TRUE(one.verdicts.empty());
  for (const auto& [id, node] : apartment().maps[0].nodes)
    EXPECT_EQ(one.components[0].map.nodes.find(id)->map_from_node.t, node.map_from_node.t);
  EXPECT_TRUE(fused({}).components.empty());
}

TEST(Fuse, refuses_two_maps_of_one_name_or_one_session) {
  EXPECT_THROW(fused({apartment().maps[0], apartment().maps[0]}), Error);
  Map copy = apartment().maps[0];
  copy.id = MapId("copy");
  EXPECT_THROW(fused({apartment().maps[0], copy}), Error);
}

TEST(Fuse, does_not_take_one_room_of_a_row_for_the_next) {
  simulation::TeamOptions options;
  options.shared = 0.0;
  simulation::RoomRowOptions rows;
  rows.furniture = 0;
  const auto team = simulation::make_repeated_rooms(rows, options);
  std::vector<Map> maps;
  for (const auto& robot : team.robots) maps.push_back(test::mapped(robot, team.laser));
  const auto result = fused(maps);
  ASSERT_EQ(result.verdicts.size(), 1U);
  EXPECT_EQ(result.verdicts[0].decision, Decision::deferred);
  EXPECT_EQ(result.verdicts[0].reason, Reason::ambiguous);
}

}  // namespace
}  // namespace mapweave::fusion
