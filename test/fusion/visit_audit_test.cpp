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

TEST(VisitAudit, finds_nothing_where_a_robot_comes_back_to_where_it_was) { EXPECT_FALSE(audit_visits(twice_around())); }

TEST(VisitAudit, finds_walls_that_stand_double) {
  const auto walls = audit_visits(moved_from(twice_around(), 0.5, {0.6, 0.6, 0.0}));
  ASSERT_TRUE(walls);
  EXPECT_GT(walls->length_m, 16.0);
  EXPECT_LT(walls->first.ns, walls->then.ns);
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
