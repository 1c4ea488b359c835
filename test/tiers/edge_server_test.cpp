#include <mapweave/tiers/edge_server.h>

#include <gmock/gmock.h>
#include <mapweave/maps/map_update.h>
#include <mapweave/tiers/cloud_merger.h>
#include <support/fake_mapper.h>
#include <support/simulated_maps.h>

namespace mapweave::tiers {
namespace {

const TierId kEdge("north");

struct EdgeTest : testing::Test {
  WorkerPool pool{1};
  std::unique_ptr<Progress> progress = make_silent_progress();
  EdgeServer edge{kEdge, {RobotId("alpha"), RobotId("beta")}, {}};
  EdgeServer::Effects end(const std::string& robot, std::optional<Map> map) {
    return edge.step({RobotId(robot), std::move(map), std::nullopt}, pool, *progress);
  }
};

TEST_F(EdgeTest, sends_the_cloud_a_whole_map_as_soon_as_its_robot_ends) {
  const Map alpha = test::make_map("alpha", 4);
  EdgeServer whole(kEdge, {RobotId("alpha"), RobotId("beta")}, {}, {false, {}});
  const auto effects = whole.step({RobotId("alpha"), alpha, std::nullopt}, pool, *progress);
  EXPECT_FALSE(effects.fused);
  ASSERT_EQ(effects.for_cloud.size(), 1u);
  const MapUpdate update = decode_map_update(effects.for_cloud[0], "test");
  EXPECT_EQ(update.origin.tier, kEdge);
  EXPECT_EQ(update.origin.map, MapId("alpha"));
  EXPECT_EQ(update.sequence, 1u);
  EXPECT_EQ(content_hash(updated(Map{}, update)), content_hash(alpha));
}

TEST_F(EdgeTest, thins_maps_once_its_last_robot_has_ended_and_sends_them_whole_when_asked) {
  const Map alpha = test::make_map("alpha", 40), beta = test::make_map("beta", 50, 900.0);
  EXPECT_TRUE(end("alpha", alpha).for_cloud.empty());
  const auto effects = end("beta", beta);
  ASSERT_EQ(effects.for_cloud.size(), 2u);
  std::size_t bytes = 0;
  for (const std::string& sent : effects.for_cloud) {
    const Map map = updated(Map{}, decode_map_update(sent, "test"));
    EXPECT_EQ(map.nodes.size(), map.id == alpha.id ? 40u : 50u);
    bytes += sent.size();
  }
  EXPECT_LT(bytes, first_update(alpha, kEdge).size() + effects.map_bytes);
  EXPECT_EQ(edge.thinning().scans, 90u);
  EXPECT_LT(edge.thinning().kept, 90u);
  const auto whole = edge.whole_maps({MapId("beta"), MapId("gamma")});
  ASSERT_EQ(whole.for_cloud.size(), 1u) << "gamma is not here";
  const MapUpdate update = decode_map_update(whole.for_cloud[0], "test");
  EXPECT_EQ(update.base, 0u);
  EXPECT_EQ(content_hash(updated(Map{}, update)), content_hash(beta));
  EXPECT_TRUE(edge.whole_maps({MapId("beta")}).for_cloud.empty()) << "it was sent";
}

// Two robots in rooms that are alike: all scans leave it open whether they are one room.
TEST_F(EdgeTest, sends_maps_whole_that_all_scans_could_not_decide) {
  simulation::RoomRowOptions hotel;
  hotel.rooms = 8;
  hotel.furniture = 2;
  simulation::TeamOptions options;
  options.shared = 0.0;
  options.seed = 5;
  const auto team = simulation::make_repeated_rooms(hotel, options);
  EdgeServer hotel_edge(kEdge, {team.robots[0].id, team.robots[1].id}, {});
  EdgeServer::Effects effects;
  for (const auto& robot : team.robots)
    effects = hotel_edge.step({robot.id, test::mapped(robot, team.laser), std::nullopt}, pool, *progress);
  ASSERT_EQ(hotel_edge.result().components.size(), 2u);
  ASSERT_EQ(hotel_edge.result().verdicts[0].reason, Reason::ambiguous);
  CloudMerger cloud(TierId("cloud"), {});
  for (const std::string& update : effects.for_cloud) cloud.receive(update, "edge north");
  for (const std::string& merged : effects.merged) cloud.receive_merged(merged, "edge north");
  const fusion::FusionResult result = cloud.seal(pool, *progress);
  EXPECT_EQ(result.components.size(), 2u);
  EXPECT_EQ(result.verdicts[0].reason, Reason::ambiguous);
  EXPECT_NEAR(result.verdicts[0].probability, hotel_edge.result().verdicts[0].probability, 0.01) << "by the same scans";
  EXPECT_TRUE(cloud.wanted_as_whole(result).empty());
}

TEST_F(EdgeTest, fuses_when_the_last_robot_has_ended_whatever_the_order) {
  const Map alpha = test::make_map("alpha", 4), beta = test::make_map("beta", 5, 900.0);
  end("alpha", alpha);
  EXPECT_TRUE(end("beta", beta).fused);
  EdgeServer other(kEdge, {RobotId("beta"), RobotId("alpha")}, {});
  other.step({RobotId("beta"), beta, std::nullopt}, pool, *progress);
  EXPECT_TRUE(other.step({RobotId("alpha"), alpha, std::nullopt}, pool, *progress).fused);
  ASSERT_EQ(edge.result().verdicts.size(), other.result().verdicts.size());
  for (std::size_t i = 0; i < edge.result().verdicts.size(); ++i)
    EXPECT_EQ(encode(edge.result().verdicts[i]).size(), encode(other.result().verdicts[i]).size());
  ASSERT_EQ(edge.result().components.size(), other.result().components.size());
  for (std::size_t i = 0; i < edge.result().components.size(); ++i)
    EXPECT_EQ(encode(difference(Map{}, edge.result().components[i].map)),
              encode(difference(Map{}, other.result().components[i].map)));
}

TEST_F(EdgeTest, takes_the_maps_of_a_robot_that_maps_on_board_as_bytes) {
  const Map alpha = test::make_map("alpha", 4), beta = test::make_map("beta", 5, 900.0);
  end("alpha", alpha);
  const auto effects = end("beta", beta);
  EdgeServer other(kEdge, {RobotId("alpha"), RobotId("beta")}, {});
  other.step({RobotId("alpha"), alpha, std::nullopt}, pool, *progress);
  const RobotUpdates sent{RobotId("beta"), {first_update(beta, TierId("beta"))}};
  EXPECT_EQ(other.step(sent, pool, *progress).for_cloud, effects.for_cloud);
  EXPECT_EQ(content_hash(*other.maps().find(MapId("beta"))), content_hash(beta));
}

TEST_F(EdgeTest, refuses_damaged_bytes_of_a_robot_and_awaits_it_still) {
  std::string bytes = first_update(test::make_map("beta", 5), TierId("beta"));
  bytes.resize(bytes.size() / 2);
  EXPECT_THROW(edge.step(RobotUpdates{RobotId("beta"), {bytes}}, pool, *progress), Error);
  end("alpha", std::nullopt);
  EXPECT_TRUE(end("beta", test::make_map("beta", 5)).fused);
}

TEST_F(EdgeTest, goes_on_with_the_others_when_a_robot_leaves_no_map) {
  end("alpha", std::nullopt);
  const auto effects = end("beta", test::make_map("beta", 5));
  EXPECT_TRUE(effects.fused);
  ASSERT_EQ(edge.result().components.size(), 1u);
  EXPECT_THAT(edge.result().components[0].members, testing::ElementsAre(MapId("beta")));
}

TEST_F(EdgeTest, has_nothing_when_no_robot_leaves_a_map) {
  end("alpha", std::nullopt);
  EXPECT_TRUE(end("beta", std::nullopt).fused);
  EXPECT_TRUE(edge.result().components.empty());
}

TEST_F(EdgeTest, refuses_a_robot_that_is_not_its_own_or_ends_twice) {
  EXPECT_THROW(end("gamma", std::nullopt), Error);
  end("alpha", std::nullopt);
  EXPECT_THROW(end("alpha", std::nullopt), Error);
}

}  // namespace
}  // namespace mapweave::tiers
