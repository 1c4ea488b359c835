#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/matching/model_cache.h>
#include <support/simulated_maps.h>

namespace mapweave::matching {
namespace {

struct Fixture {
  simulation::SimulatedTeam team;
  Map map;
  Fixture() {
    simulation::TeamOptions options;
    options.robots = 1;
    options.length_m = 12.0;
    team = simulation::make_apartment({}, options);
    map = test::truth_map(team.robots[0], team.laser);
  }
  const Submap& first() const { return map.submaps.front().second; }
};

TEST(SubmapModel, distinguishes_walls_from_free_space) {
  const Fixture f;
  const SubmapModel model(f.first(), f.map.nodes);
  ASSERT_GT(model.walls().size(), 50U);
  for (const auto& wall : model.walls())
    EXPECT_EQ(model.sight().get(cell_of(wall.x, 10.0), cell_of(wall.y, 10.0)), Sight::wall);
  // Where the robot drove there is room.
  std::size_t free = 0;
  for (const auto& [id, pose] : f.first().submap_from_node)
    free += model.sight().get(cell_of(pose.t.x(), 10.0), cell_of(pose.t.y(), 10.0)) == Sight::free;
  EXPECT_GT(free, f.first().submap_from_node.size() * 9 / 10);
  EXPECT_EQ(model.sight().get(100000, 0), Sight::unknown);
}

TEST(SubmapModel, turns_normals_towards_where_walls_were_seen_from) {
  const Fixture f;
  const SubmapModel model(f.first(), f.map.nodes);
  std::size_t inward = 0;
  for (const auto& wall : model.walls()) {
    // A step along the normal is free or at least not farther from the path than the wall.
    const Sight ahead =
        model.sight().get(cell_of(wall.x + 0.25 * wall.normal_x, 10.0), cell_of(wall.y + 0.25 * wall.normal_y, 10.0));
    inward += ahead == Sight::free;
  }
  EXPECT_GT(static_cast<double>(inward), 0.6 * static_cast<double>(model.walls().size()));
}

TEST(SubmapModel, has_pyramid_levels_that_bound_the_level_below) {
  const Fixture f;
  const SubmapModel model(f.first(), f.map.nodes);
  for (std::size_t level = 1; level < model.pyramid().size(); ++level) {
    const auto& base = model.pyramid()[0];
    const auto& bound = model.pyramid()[level];
    const int size = 1 << (2 * level);
    for (int y = base.first_y(); y < base.first_y() + base.height(); y += 3)
      for (int x = base.first_x(); x < base.first_x() + base.width(); x += 3) {
        // Cell i bounds [i, i + 2) * 4^level.
        const int i = x >> (2 * level), j = y >> (2 * level);
        ASSERT_GE(bound.get(i, j), base.get(x, y)) << "level " << level;
        ASSERT_GE(bound.get((x - size) >> (2 * level), (y - size) >> (2 * level)), base.get(x, y)) << "level " << level;
      }
  }
}

TEST(SubmapModel, looks_alike_from_the_same_place_and_different_elsewhere) {
  simulation::TeamOptions options;
  options.robots = 2;
  options.shared = 1.0;
  const auto team = simulation::make_apartment({}, options);
  const Map a = test::truth_map(team.robots[0], team.laser), b = test::truth_map(team.robots[1], team.laser);
  const SubmapModel one(a.submaps.front().second, a.nodes), last(a.submaps.back().second, a.nodes);
  EXPECT_EQ(ring_distance(one, one), 0.0);
  EXPECT_GT(ring_distance(one, last), 0.3);
}

TEST(SubmapModel, wants_frozen_submaps_and_known_nodes) {
  Fixture f;
  Submap open = f.first();
  open.frozen = false;
  EXPECT_THROW(SubmapModel(open, f.map.nodes), ContractViolation);
  EXPECT_THROW(SubmapModel(f.first(), {}), ContractViolation);
}

TEST(ModelCache, answers_alike_with_room_and_without) {
  const Fixture f;
  ModelCache large(1U << 30), tiny(1);
  for (int round = 0; round < 2; ++round)
    for (const auto& [id, submap] : f.map.submaps) {
      const auto a = large.get(submap, f.map.nodes), b = tiny.get(submap, f.map.nodes);
      ASSERT_EQ(a->walls().size(), b->walls().size());
      EXPECT_EQ(a->known_cells(), b->known_cells());
    }
  EXPECT_EQ(large.get(f.first(), f.map.nodes), large.get(f.first(), f.map.nodes));
}

}  // namespace
}  // namespace mapweave::matching
