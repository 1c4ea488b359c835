#include "fused_maps.h"

#include <gtest/gtest.h>
#include <mapweave/fusion/visit_audit.h>
#include <support/simulated_maps.h>

namespace mapweave::fusion {
namespace {

// One robot that drives around a ring twice.
const Map& twice_around() {
  static const Map map = [] {
    simulation::TeamOptions team;
    team.robots = 1;
    team.length_m = 160.0;
    const auto world = simulation::make_ring({30.0, 20.0, 2.0, 12, 16}, team);
    return test::mapped(world.robots[0], world.laser);
  }();
  return map;
}

// What was driven after `share` of the scans, moved as a whole.
Map moved_from(const Map& map, double share, const Pose2& by) {
  Map result = map;
  auto left = static_cast<std::size_t>(share * static_cast<double>(map.nodes.size()));
  for (const auto& [id, node] : map.nodes) {
    if (left > 0) {
      --left;
      continue;
    }
    Pose3& pose = result.nodes.find(id)->map_from_node;
    pose = spatial(compose(by, planar(pose)));
  }
  return result;
}

// Half of it lies elsewhere, and its loops hold it there: its own graph is sure of walls that stand double.
Map sure_of_ghosts(const Map& map) {
  Map bent = moved_from(map, 0.5, {0.6, 0.6, 0.0});
  for (auto& [id, constraint] : bent.constraints)
    constraint.from_from_to.pose =
        between(bent.nodes.find(id.from)->map_from_node, bent.nodes.find(id.to)->map_from_node);
  EXPECT_TRUE(audit_visits(bent));
  return bent;
}

// A robot's own map, with its places where the team has them.
Map as_in(const Map& team, const Map& own) {
  Map placed = own;
  for (auto& [id, node] : placed.nodes) node = *team.nodes.find(id);
  return placed;
}

TEST(VisitAudit, finds_nothing_where_a_robot_comes_back_to_where_it_was) { EXPECT_FALSE(audit_visits(twice_around())); }

TEST(VisitAudit, finds_walls_that_stand_double) {
  const auto walls = audit_visits(moved_from(twice_around(), 0.5, {0.6, 0.6, 0.0}));
  ASSERT_TRUE(walls);
  EXPECT_GT(walls->length_m, 16.0);
  EXPECT_LT(walls->first.ns, walls->then.ns);
}

// In a team the search for matches goes on where one robot's own walls stand double.
TEST(VisitAudit, leads_to_a_search_in_a_team) {
  simulation::TeamOptions options;
  options.robots = 2;
  options.length_m = 160.0;
  const auto world = simulation::make_ring({30.0, 20.0, 2.0, 12, 16}, options);
  const Map bent = sure_of_ghosts(test::mapped(world.robots[0], world.laser));
  const FusionResult result = test::fused({bent, test::mapped(world.robots[1], world.laser)});
  ASSERT_EQ(result.components.size(), 1U);
  EXPECT_FALSE(audit_visits(as_in(result.components[0].map, bent)));
  EXPECT_EQ(result.components[0].bent, std::vector<MapId>{bent.id});
}

TEST(VisitAudit, leads_to_a_search_where_a_robot_is_alone) {
  const Map bent = sure_of_ghosts(twice_around());
  const FusionResult result = test::fused({bent});
  ASSERT_EQ(result.components.size(), 1U);
  EXPECT_FALSE(audit_visits(as_in(result.components[0].map, bent)));
  EXPECT_EQ(result.components[0].bent, std::vector<MapId>{bent.id});
  EXPECT_TRUE(test::fused({twice_around()}).components[0].bent.empty());
}

TEST(VisitAudit, has_nothing_to_say_of_an_empty_map_or_a_single_visit) {
  EXPECT_FALSE(audit_visits(Map()));
  simulation::TeamOptions team;
  team.robots = 1;
  team.length_m = 20.0;
  const auto world = simulation::make_ring({30.0, 20.0, 2.0, 12, 16}, team);
  EXPECT_FALSE(audit_visits(test::mapped(world.robots[0], world.laser)));
}

}  // namespace
}  // namespace mapweave::fusion
