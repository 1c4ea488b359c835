#include "fused_maps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/maps/reasons.h>
#include <support/pose_matchers.h>
#include <support/simulated_maps.h>

#include <algorithm>

namespace mapweave::fusion {
namespace {

using test::fused;
using test::IsNear;

std::vector<Map> mapped(const simulation::SimulatedTeam& team) {
  std::vector<Map> maps;
  for (const auto& robot : team.robots) maps.push_back(test::mapped(robot, team.laser));
  return maps;
}

simulation::SimulatedTeam apartment(int robots, double shared) {
  simulation::TeamOptions options;
  options.robots = robots;
  options.shared = shared;
  return simulation::make_apartment({}, options);
}

// As the robot would have recorded it in a mirror.
simulation::SimulatedRobot mirrored(simulation::SimulatedRobot robot) {
  robot.id = RobotId("mirrored");
  for (auto& step : robot.steps) {
    std::reverse(step.ranges.begin(), step.ranges.end());
    step.odometry_from_robot = {step.odometry_from_robot.x, -step.odometry_from_robot.y, -step.odometry_from_robot.phi};
  }
  return robot;
}

TEST(LaserTeam, is_the_same_whatever_robots_are_called) {
  auto team = apartment(2, 0.6);
  const auto before = fused(mapped(team));
  team.robots[0].id = RobotId("zeta");
  team.robots[1].id = RobotId("alpha");
  const auto after = fused(mapped(team));
  ASSERT_EQ(before.verdicts.size(), 1U);
  ASSERT_EQ(after.verdicts.size(), 1U);
  EXPECT_EQ(before.verdicts[0].decision, Decision::accepted);
  EXPECT_EQ(after.verdicts[0].decision, Decision::accepted);
  EXPECT_EQ(before.verdicts[0].witnesses.size(), after.verdicts[0].witnesses.size());
  EXPECT_NEAR(before.verdicts[0].probability, after.verdicts[0].probability, 1e-6);
  EXPECT_THAT(inverse(planar(after.verdicts[0].alignment->a_from_b.pose)),
              IsNear(planar(before.verdicts[0].alignment->a_from_b.pose), 3e-3, 2e-4));
  const Pose2 a_from_b = planar(before.components[0].team_from_map.find(MapId("robot1"))->t.isZero()
                                    ? *before.components[0].team_from_map.find(MapId("robot0"))
                                    : *before.components[0].team_from_map.find(MapId("robot1")));
  EXPECT_THAT(inverse(planar(*after.components[0].team_from_map.find(MapId("zeta")))), IsNear(a_from_b, 5e-3, 1e-3));
}

TEST(LaserTeam, compares_a_map_with_those_most_like_it_first) {
  FusionInput input;
  input.maps = mapped(apartment(6, 0.3));
  WorkerPool pool(1);
  const auto pairs = first_pairs(input, {}, pool);
  EXPECT_LT(pairs.size(), 15U) << "not all of them";
  for (const Map& map : input.maps)
    EXPECT_GE(std::count_if(pairs.begin(), pairs.end(),
                            [&](const FirstPair& pair) { return pair.a == map.id || pair.b == map.id; }),
              3);
  std::reverse(input.maps.begin(), input.maps.end());
  const auto reversed = first_pairs(input, {}, pool);
  ASSERT_EQ(reversed.size(), pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_TRUE(reversed[i].a == pairs[i].a && reversed[i].b == pairs[i].b);
    ASSERT_EQ(reversed[i].submaps.size(), pairs[i].submaps.size());
    for (std::size_t k = 0; k < pairs[i].submaps.size(); ++k)
      EXPECT_TRUE(reversed[i].submaps[k].a == pairs[i].submaps[k].a &&
                  reversed[i].submaps[k].b == pairs[i].submaps[k].b);
  }
}

TEST(LaserTeam, says_who_proposed_a_merge_and_who_was_asked_last) {
  const auto team = apartment(2, 0.6);
  EXPECT_EQ(fused(mapped(team)).verdicts[0].proposer, "ring keys");
  auto image = mirrored(team.robots[0]);
  FusionInput input{{test::mapped(team.robots[0], team.laser), test::mapped(image, team.laser)}, {}, TierId("cloud")};
  for (const auto& [last, name] : {std::pair(Proposer::ring_keys, "ring keys"),
                                   {Proposer::whole_maps, "whole maps"},
                                   {Proposer::corners, "corners"}}) {
    FusionOptions options;
    options.last_proposer = last;
    WorkerPool pool(1);
    Memo memo;
    const auto result = fuse(input, options, memo, pool, *make_silent_progress());
    EXPECT_EQ(result.components.size(), 2U);
    EXPECT_EQ(result.verdicts[0].proposer, name);
  }
}

TEST(LaserTeam, leaves_a_log_and_its_mirror_image_apart_under_any_name) {
  const auto team = apartment(2, 0.6);
  for (const char* name : {"aaa", "zzz"}) {
    auto robot = mirrored(team.robots[0]);
    robot.id = RobotId(name);
    const auto result = fused({test::mapped(team.robots[0], team.laser), test::mapped(robot, team.laser)});
    EXPECT_EQ(result.components.size(), 2U) << name;
    EXPECT_EQ(result.verdicts[0].reason, Reason::contradiction) << name << to_text(result.verdicts[0].reason);
    EXPECT_EQ(in_words(result.verdicts[0].reason), "one saw through walls of the other");
  }
}

TEST(LaserTeam, is_not_made_of_robots_that_were_in_different_rooms_which_look_alike) {
  for (const std::int64_t seed : {1, 2, 3, 4}) {
    simulation::RoomRowOptions rows;
    rows.rooms = 8;
    rows.furniture = 2;
    simulation::TeamOptions options;
    options.shared = 0.0;
    options.seed = seed;
    const auto team =
        seed % 2 == 0 ? simulation::make_mirrored_rooms(rows, options) : simulation::make_repeated_rooms(rows, options);
    EXPECT_EQ(fused(mapped(team)).components.size(), 2U) << "seed " << seed;
  }
}

// Two warehouses of one maker: the racks of one stand 6 to 11 cm farther apart, which ICP forgives.
TEST(LaserTeam, is_not_made_of_robots_in_two_warehouses_whose_aisles_differ_by_centimetres) {
  simulation::WorldOptions world;
  for (const auto& [aisles, length_m, aisle_m] : {std::tuple(8, 13.8, 2.43), {6, 16.8, 2.54}, {8, 13.3, 2.37}}) {
    simulation::BuildingOptions building;
    building.kind = simulation::PlanKind::warehouse;
    building.warehouse.aisles = aisles;
    building.warehouse.length_m = length_m;
    building.warehouse.aisle_m = aisle_m;
    building.warehouse.pallets = 0;
    simulation::RobotOptions robot;
    robot.id = "robot" + std::to_string(world.robots.size());
    robot.building = static_cast<int>(world.buildings.size());
    robot.length_m = 25.0;
    world.buildings.push_back(building);
    world.robots.push_back(robot);
  }
  const auto result = fused(mapped(simulation::recorded(world)));
  EXPECT_EQ(result.components.size(), 3U);
  EXPECT_TRUE(std::any_of(result.verdicts.begin(), result.verdicts.end(),
                          [](const Verdict& verdict) { return verdict.reason == Reason::other_widths; }));
}

// Rooms of a hotel, each robot in its own; the prior lays those of the second one on those of the first one, which look
// the same.
TEST(LaserTeam, believes_a_prior_that_is_wrong_by_whole_rooms_where_rooms_repeat) {
  simulation::RoomRowOptions hotel;
  hotel.rooms = 8;
  hotel.furniture = 2;
  simulation::TeamOptions options;
  options.shared = 0.0;
  options.seed = 3;
  const auto team = simulation::make_repeated_rooms(hotel, options);
  const Pose2 &first = team.robots[0].steps.front().world_from_robot,
              &second = team.robots[1].steps.front().world_from_robot;
  Pose2 wrong = second;
  wrong.x -= 4.0 * hotel.room_width_m;
  FusionInput input{
      {test::truth_map(team.robots[0], team.laser), test::truth_map(team.robots[1], team.laser)}, {}, TierId("cloud")};
  const auto fused_here = [&] {
    WorkerPool pool(1);
    Memo memo;
    return fuse(input, {}, memo, pool, *make_silent_progress());
  };
  EXPECT_EQ(fused_here().components.size(), 2U) << "without a prior they stay apart";
  input.priors = {{MapId("robot0"), MapId("robot1"), between(first, wrong), 0.5, 0.1}};
  const auto result = fused_here();
  ASSERT_EQ(result.components.size(), 1U);
  EXPECT_THAT(planar(*result.components[0].team_from_map.find(MapId("robot1"))),
              IsNear(between(first, wrong), 0.3, 0.05));
  EXPECT_FALSE(result.verdicts[0].prior->is_contradicted) << "nothing can find it out";
  input.priors[0].a_from_b = between(first, second);
  const auto right = fused_here();
  ASSERT_EQ(right.components.size(), 1U);
  EXPECT_THAT(planar(*right.components[0].team_from_map.find(MapId("robot1"))),
              IsNear(between(first, second), 0.1, 0.02));
}

TEST(LaserTeam, of_a_small_flat_is_one_map_within_a_centimetre) {
  simulation::ApartmentOptions flat;
  flat.width_m = flat.height_m = 5.0;
  flat.corridor_width_m = 1.2;
  flat.room_width_m = 2.0;
  simulation::TeamOptions options;
  options.robots = 3;
  options.shared = 1.0;
  options.length_m = 12.0;
  options.motion.clearance_m = 0.2;
  const auto team = simulation::make_apartment(flat, options);
  const auto result = fused(mapped(team));
  ASSERT_EQ(result.components.size(), 1U);
  for (std::size_t i = 1; i < 3; ++i) {
    const Pose2 truth =
        between(team.robots[0].steps.front().world_from_robot, team.robots[i].steps.front().world_from_robot);
    EXPECT_THAT(planar(*result.components[0].team_from_map.find(MapId("robot" + std::to_string(i)))),
                IsNear(truth, 0.01, 0.01));
  }
}

// Of a room as small as this, hardly anything fits nowhere around.
TEST(LaserTeam, of_a_room_of_four_metres_is_one_map) {
  simulation::WorldOptions world;
  world.seed = 2;
  world.robot_radius_m = 0.1;
  world.motion.speed_min_m_per_s = world.motion.speed_max_m_per_s = 0.2;
  world.motion.clearance_m = 0.2;
  simulation::BuildingOptions building;
  building.kind = simulation::PlanKind::apartment;
  building.seed = 2;
  building.apartment.width_m = building.apartment.height_m = 4.0;
  building.apartment.corridor_width_m = 1.2;
  building.apartment.room_width_m = 2.0;
  world.buildings = {building};
  for (const auto order : {simulation::TourOrder::along, simulation::TourOrder::back, simulation::TourOrder::shuffled,
                           simulation::TourOrder::along}) {
    simulation::RobotOptions robot;
    robot.id = "robot" + std::to_string(world.robots.size());
    robot.first_room = static_cast<int>(world.robots.size() % 2);
    robot.order = order;
    robot.length_m = 12.0;
    world.robots.push_back(robot);
  }
  EXPECT_EQ(fused(mapped(simulation::recorded(world))).components.size(), 1U);
}

TEST(LaserTeam, places_a_robot_that_only_a_third_one_met) {
  const auto team = apartment(3, 0.5);
  const auto result = fused(mapped(team));
  ASSERT_EQ(result.components.size(), 1U);
  for (std::size_t i = 1; i < 3; ++i) {
    const Pose2 truth =
        between(team.robots[0].steps.front().world_from_robot, team.robots[i].steps.front().world_from_robot);
    EXPECT_THAT(planar(*result.components[0].team_from_map.find(MapId("robot" + std::to_string(i)))),
                IsNear(truth, 0.1, 0.02));
  }
}

TEST(LaserTeam, finds_robots_that_share_a_corner_of_their_maps) {
  int merged = 0;
  for (const std::int64_t seed : {1, 2, 3, 4, 5, 6}) {
    simulation::TeamOptions options;
    options.shared = 0.0;
    options.seed = seed;
    const auto team = simulation::make_apartment({}, options);
    const auto result = fused(mapped(team));
    if (result.components.size() > 1) continue;
    ++merged;
    const Pose2 truth =
        between(team.robots[0].steps.front().world_from_robot, team.robots[1].steps.front().world_from_robot);
    EXPECT_THAT(planar(*result.components[0].team_from_map.find(MapId("robot1"))), IsNear(truth, 0.1, 0.02))
        << "seed " << seed;
  }
  EXPECT_GE(merged, 4);
}

TEST(LaserTeam, bends_a_map_that_one_of_its_members_holds_straight) {
  // The second robot's map is bent by hand: its own graph says so, too. The first one's walls say otherwise.
  const auto team = apartment(2, 1.0);
  auto maps = mapped(team);
  std::size_t i = 0;
  const std::size_t count = maps[1].nodes.size();
  for (auto& [id, node] : maps[1].nodes) {
    const double share = static_cast<double>(i++) / static_cast<double>(count);
    node.map_from_node = compose(spatial(Pose2{0.0, 0.3 * share, 0.02 * share}), node.map_from_node);
  }
  const auto result = fused(maps);
  ASSERT_EQ(result.components.size(), 1U);
  double worst_m = 0.0;
  for (std::size_t r = 0; r < 2; ++r) {
    std::size_t step = 0;
    for (const auto& [id, node] : maps[r].nodes) {
      const Pose2 truth =
          between(team.robots[0].steps.front().world_from_robot, team.robots[r].steps.at(step++).world_from_robot);
      const Pose2 pose = planar(result.components[0].map.nodes.find(id)->map_from_node);
      worst_m = std::max(worst_m, std::hypot(pose.x - truth.x, pose.y - truth.y));
    }
  }
  EXPECT_LT(worst_m, 0.15);
}

// The farthest that two robots' nodes of one component lie from where they were to each other, of those that were
// within 2 m.
double worst_between_robots(const FusionResult& result, const std::vector<Map>& maps,
                            const simulation::SimulatedTeam& team) {
  double worst_m = 0.0;
  for (const Component& component : result.components)
    for (std::size_t a = 0; a < maps.size(); ++a)
      for (std::size_t b = a + 1; b < maps.size(); ++b) {
        std::size_t i = 0;
        for (const auto& [id_a, node_a] : maps[a].nodes) {
          const Pose2 true_a = team.robots[a].steps.at(i++).world_from_robot;
          std::size_t j = 0;
          for (const auto& [id_b, node_b] : maps[b].nodes) {
            const Pose2 truth = between(true_a, team.robots[b].steps.at(j++).world_from_robot);
            const Node *in_a = component.map.nodes.find(id_a), *in_b = component.map.nodes.find(id_b);
            if (in_a == nullptr || in_b == nullptr || std::hypot(truth.x, truth.y) > 2.0) continue;
            const Pose2 found = between(planar(in_a->map_from_node), planar(in_b->map_from_node));
            worst_m = std::max(worst_m, std::hypot(found.x - truth.x, found.y - truth.y));
          }
        }
      }
  return worst_m;
}

TEST(LaserTeam, of_maps_that_are_all_bent_is_right_or_says_why) {
  for (const double bend_rad : {0.05, 0.2, 0.6}) {
    const auto team = apartment(3, 0.6);
    auto maps = mapped(team);
    for (std::size_t r = 0; r < maps.size(); ++r) {
      std::size_t i = 0;
      for (auto& [id, node] : maps[r].nodes) {
        const double share = static_cast<double>(i++) / static_cast<double>(maps[r].nodes.size()),
                     side = r == 1 ? -1.0 : 1.0;
        node.map_from_node = compose(spatial(Pose2{0.0, 0.0, side * bend_rad * share}), node.map_from_node);
      }
    }
    const auto result = fused(maps);
    EXPECT_LT(worst_between_robots(result, maps, team), 0.4) << bend_rad;
    for (const Verdict& verdict : result.verdicts) {
      // What can be mended is merged; else walls were seen through wherever the maps are laid.
      constexpr double kMended_rad = 0.1;
      EXPECT_EQ(verdict.decision == Decision::accepted, verdict.reason == Reason::none) << bend_rad;
      EXPECT_EQ(verdict.reason, bend_rad < kMended_rad ? Reason::none : Reason::contradiction)
          << bend_rad << to_text(verdict.reason);
    }
  }
}

TEST(LaserTeam, with_a_robot_that_stands_still_is_right_or_shows_too_little) {
  const auto team = apartment(2, 0.6);
  for (const std::size_t at : {std::size_t{0}, team.robots[1].steps.size() / 2}) {
    auto still = team.robots[1];
    for (auto& step : still.steps) {
      step.world_from_robot = team.robots[1].steps[at].world_from_robot;
      step.odometry_from_robot = team.robots[1].steps[at].odometry_from_robot;
      step.ranges = team.robots[1].steps[at].ranges;
    }
    const auto result = fused({test::mapped(team.robots[0], team.laser), test::mapped(still, team.laser)});
    ASSERT_EQ(result.verdicts.size(), 1U);
    const Verdict& verdict = result.verdicts[0];
    if (result.components.size() == 1) {
      const Pose2 truth = between(team.robots[0].steps.front().world_from_robot, still.steps.front().world_from_robot);
      EXPECT_THAT(planar(*result.components[0].team_from_map.find(MapId("robot1"))), IsNear(truth, 0.3, 0.05)) << at;
    } else {
      EXPECT_THAT(verdict.reason, testing::Eq(Reason::little_evidence)) << at << to_text(verdict.reason);
    }
  }
}

}  // namespace
}  // namespace mapweave::fusion
