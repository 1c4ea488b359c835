#include "decision/same_recording.h"
#include "fused_maps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/fusion/thinning.h>
#include <support/pose_matchers.h>
#include <support/simulated_maps.h>

namespace mapweave::fusion {
namespace {

using test::fused;

const simulation::SimulatedTeam& apartment() {
  static const simulation::SimulatedTeam team = [] {
    simulation::TeamOptions options;
    options.robots = 2;
    options.shared = 0.6;
    return simulation::make_apartment({}, options);
  }();
  return team;
}

simulation::SimulatedRobot renamed(simulation::SimulatedRobot robot, const char* name, double later_s = 0.0) {
  robot.id = RobotId(name);
  for (auto& step : robot.steps) step.stamp.ns += static_cast<std::int64_t>(later_s * 1e9);
  return robot;
}

Map mapped(const simulation::SimulatedRobot& robot) { return test::mapped(robot, apartment().laser); }

TEST(SameRecording, under_another_name_counts_once) {
  const auto result = fused(
      {mapped(apartment().robots[0]), mapped(apartment().robots[1]), mapped(renamed(apartment().robots[0], "again"))});
  ASSERT_EQ(result.components.size(), 2U);
  EXPECT_THAT(result.components[0].members.size() + result.components[1].members.size(), 3U);
  ASSERT_EQ(result.verdicts.size(), 2U);
  const auto copy = std::find_if(result.verdicts.begin(), result.verdicts.end(),
                                 [](const Verdict& v) { return v.reason == Reason::same_recording; });
  ASSERT_NE(copy, result.verdicts.end());
  EXPECT_EQ(copy->a.str(), "again");
  EXPECT_EQ(copy->b.str(), "robot0");
  EXPECT_EQ(copy->decision, Decision::refused);
  EXPECT_GT(copy->overlap, 0.95);
}

TEST(SameRecording, shifted_in_time_counts_once) {
  const auto result = fused({mapped(apartment().robots[0]), mapped(renamed(apartment().robots[0], "later", 3600.25))});
  EXPECT_EQ(result.components.size(), 2U);
  ASSERT_EQ(result.verdicts.size(), 1U);
  EXPECT_EQ(result.verdicts[0].reason, Reason::same_recording);
}

TEST(SameRecording, of_the_first_half_alone_counts_once) {
  auto half = renamed(apartment().robots[0], "half");
  half.steps.resize(half.steps.size() / 2);
  const auto result = fused({mapped(apartment().robots[0]), mapped(half)});
  ASSERT_EQ(result.verdicts.size(), 1U);
  EXPECT_EQ(result.verdicts[0].reason, Reason::same_recording);
}

TEST(SameRecording, is_not_two_parts_of_one_log_that_share_some_seconds) {
  auto first = renamed(apartment().robots[0], "first"), second = renamed(apartment().robots[0], "second");
  const std::size_t count = first.steps.size();
  first.steps.resize(2 * count / 3);
  second.steps.erase(second.steps.begin(), second.steps.begin() + static_cast<std::ptrdiff_t>(count / 3));
  const auto result = fused({mapped(first), mapped(second)});
  ASSERT_EQ(result.verdicts.size(), 1U);
  EXPECT_NE(result.verdicts[0].reason, Reason::same_recording);
  EXPECT_EQ(result.components.size(), 1U);
}

// As an edge sends it, which merged it with another robot's.
TEST(SameRecording, that_an_edge_thinned_counts_once_whichever_robot_comes_first) {
  for (const auto& [neighbour, kept, again] : {std::tuple("a", "b", "c"), {"b", "a", "c"}, {"c", "b", "a"}}) {
    std::vector<Map> edge{mapped(renamed(apartment().robots[1], neighbour)),
                          mapped(renamed(apartment().robots[0], kept))};
    const FusionResult merged = fused(edge);
    ASSERT_EQ(merged.components.size(), 1U);
    std::sort(edge.begin(), edge.end(), [](const Map& one, const Map& other) { return one.id < other.id; });
    std::vector<Map> sent = thinned(merged.components[0], {&edge[0], &edge[1]}, {}).maps;
    const Map alone = mapped(renamed(apartment().robots[0], again));
    const FusionResult by_itself = fused({alone});
    for (const bool is_thinned : {false, true}) {
      std::vector<Map> maps = sent;
      maps.push_back(is_thinned ? thinned(by_itself.components.at(0), {&alone}, {}).maps.at(0) : alone);
      const FusionResult result = fused(maps);
      const auto copy = std::find_if(result.verdicts.begin(), result.verdicts.end(),
                                     [](const Verdict& v) { return v.reason == Reason::same_recording; });
      ASSERT_NE(copy, result.verdicts.end()) << again << is_thinned;
      EXPECT_EQ(std::minmax(copy->a.str(), copy->b.str()), std::minmax(std::string(kept), std::string(again)));
    }
  }
}

TEST(SameRecording, is_not_two_parts_of_one_log_that_an_edge_thinned) {
  auto first = renamed(apartment().robots[0], "first"), second = renamed(apartment().robots[0], "second");
  const auto count = static_cast<std::ptrdiff_t>(first.steps.size());
  first.steps.resize(static_cast<std::size_t>(count * 6 / 10));
  second.steps.erase(second.steps.begin(), second.steps.begin() + count * 4 / 10);
  const Map maps[] = {mapped(first), mapped(second)};
  std::vector<Map> sent;
  for (const Map& map : maps) sent.push_back(thinned(fused({map}).components.at(0), {&map}, {}).maps.at(0));
  for (const Verdict& verdict : fused(sent).verdicts) EXPECT_NE(verdict.reason, Reason::same_recording);
}

TEST(SameRecording, of_a_robot_that_stands_still_counts_once_and_joins_nothing) {
  auto still = apartment().robots[1];
  for (auto& step : still.steps) {
    step.odometry_from_robot = still.steps.front().odometry_from_robot;
    step.ranges = still.steps.front().ranges;
  }
  const auto result = fused({mapped(renamed(still, "still")), mapped(renamed(still, "stiller", 60.0))});
  EXPECT_EQ(result.components.size(), 2U);
  ASSERT_EQ(result.verdicts.size(), 1U);
  EXPECT_EQ(result.verdicts[0].reason, Reason::same_recording);
  // Beside a robot that drives it is merged rightly, or stays apart and says why.
  const auto beside = fused({mapped(apartment().robots[0]), mapped(renamed(still, "still"))});
  ASSERT_EQ(beside.verdicts.size(), 1U);
  if (beside.verdicts[0].decision == Decision::accepted) {
    const Pose2 truth = between(apartment().robots[0].steps.front().world_from_robot,
                                apartment().robots[1].steps.front().world_from_robot);
    EXPECT_THAT(planar(beside.verdicts[0].alignment->a_from_b.pose), test::IsNear(truth, 0.3, 0.05));
  } else {
    EXPECT_NE(beside.verdicts[0].reason, Reason::none);
  }
}

TEST(SameRecording, of_maps_that_show_nothing_is_unknown) {
  Map one, other;
  one.id = MapId("one");
  other.id = MapId("other");
  for (Map* map : {&one, &other}) {
    ScanGeometry geometry;
    geometry.ray_count = 90;
    const auto shared = std::make_shared<const ScanGeometry>(geometry);
    for (std::uint32_t i = 0; i < 5; ++i) {
      Node node;
      node.id = {{{RobotId(map->id.str()), SensorId("laser")}, 1}, i};
      node.payload = std::make_shared<const Payload>(PackedScan{shared, std::vector<std::uint16_t>(90, 0)});
      map->nodes.set(node.id, node);
    }
  }
  const auto copies = copies_among({&one, &other});
  EXPECT_FALSE(copies[0]);
  EXPECT_FALSE(copies[1]);
}

TEST(SameRecording, of_which_there_are_three_counts_once) {
  const Map map = mapped(apartment().robots[0]);
  const auto copies = copies_among({&map, &map, &map});
  EXPECT_FALSE(copies[0]);
  ASSERT_TRUE(copies[1] && copies[2]);
  EXPECT_EQ(copies[1]->original, 0U);
  EXPECT_EQ(copies[2]->original, 0U);
}

// A map with one submap: merged rightly, or apart with a reason; never wrongly.
TEST(LaserTeam, with_a_map_of_one_submap_is_right_or_says_why) {
  auto brief = apartment().robots[1];
  brief.steps.resize(8);
  const Map map = mapped(brief);
  ASSERT_EQ(map.submaps.size(), 1U);
  const auto result = fused({mapped(apartment().robots[0]), map});
  ASSERT_EQ(result.verdicts.size(), 1U);
  const Pose2 truth = between(apartment().robots[0].steps.front().world_from_robot,
                              apartment().robots[1].steps.front().world_from_robot);
  if (result.components.size() == 1)
    EXPECT_THAT(planar(*result.components[0].team_from_map.find(MapId("robot1"))), test::IsNear(truth, 0.3, 0.05));
  else
    EXPECT_EQ(result.verdicts[0].reason, Reason::too_few_witnesses) << to_text(result.verdicts[0].reason);
}

}  // namespace
}  // namespace mapweave::fusion
