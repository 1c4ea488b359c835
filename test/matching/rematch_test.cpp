#include <gtest/gtest.h>
#include <mapweave/graph/pose_graph.h>
#include <mapweave/matching/rematch.h>
#include <support/pose_matchers.h>
#include <support/simulated_maps.h>

#include <algorithm>

namespace mapweave::matching {
namespace {

Map mapped_apartment(double length_m) {
  simulation::TeamOptions options;
  options.robots = 1;
  options.length_m = length_m;
  const auto team = simulation::make_apartment({}, options);
  return test::truth_map(team.robots[0], team.laser);
}

TEST(Rematch, finds_the_true_relations_from_slightly_wrong_poses) {
  const Map truth = mapped_apartment(40.0);
  Map bent = truth;
  for (auto& [id, node] : bent.nodes) {
    const double t = 0.0005 * id.index;  // a slow bend
    node.map_from_node =
        compose(spatial(Pose2{0.05 * std::sin(t), 0.05 * std::cos(t), 0.01 * std::sin(3 * t)}), node.map_from_node);
  }
  WorkerPool pool(2);
  const auto constraints = rematch(bent, {}, pool);
  ASSERT_GT(constraints.size(), 50U);
  std::vector<double> errors;
  for (const auto& c : constraints) {
    const Pose2 expected =
        between(planar(truth.nodes.find(c.id.from)->map_from_node), planar(truth.nodes.find(c.id.to)->map_from_node));
    const Pose2 apart = between(expected, planar(c.from_from_to.pose));
    errors.push_back(std::hypot(apart.x, apart.y));
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.01);
  EXPECT_LT(errors[errors.size() * 9 / 10], 0.015);
}

TEST(Rematch, gives_the_same_constraints_for_any_number_of_threads) {
  const Map map = mapped_apartment(25.0);
  WorkerPool one(1), three(3);
  const auto a = rematch(map, {}, one), b = rematch(map, {}, three);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_TRUE(a[i].id == b[i].id);
    EXPECT_EQ(a[i].from_from_to.pose.t, b[i].from_from_to.pose.t);
  }
}

TEST(Rematch, gives_the_same_constraints_with_submaps_that_are_ready_and_none_of_those_left_out) {
  const Map map = mapped_apartment(25.0);
  WorkerPool pool(1);
  ModelCache models(std::size_t{64} << 20U);
  const SubmapId ready = map.submaps.begin()->first;
  models.get(map.submaps.begin()->second, map.nodes);
  const auto all = rematch(map, {}, pool), with_models = rematch(map, {}, pool, {}, &models);
  ASSERT_EQ(all.size(), with_models.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_TRUE(all[i].id == with_models[i].id);
    EXPECT_EQ(all[i].from_from_to.pose.t, with_models[i].from_from_to.pose.t);
  }
  const auto fewer = rematch(map, {}, pool, [&](const NodeId&, const Submap& submap) { return submap.id == ready; });
  EXPECT_LT(fewer.size(), all.size());
  EXPECT_TRUE(std::none_of(fewer.begin(), fewer.end(), [](const Constraint& c) { return c.id.index == 1; }))
      << "counted from one";
}

TEST(Rematch, can_be_switched_off) {
  simulation::TeamOptions options;
  options.robots = 1;
  options.length_m = 10.0;
  const auto team = simulation::make_apartment({}, options);
  WorkerPool pool(1);
  RematchOptions off;
  off.most_submaps = 0;
  EXPECT_TRUE(rematch(test::truth_map(team.robots[0], team.laser), off, pool).empty());
}

}  // namespace
}  // namespace mapweave::matching
