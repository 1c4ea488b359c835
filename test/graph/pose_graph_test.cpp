#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/graph/pose_graph.h>
#include <support/pose_matchers.h>

#include <limits>
#include <random>

namespace mapweave::graph {
namespace {

using test::IsNear;

Eigen::Matrix3d information(double sigma_m, double sigma_yaw_rad) {
  return Eigen::Vector3d(1 / (sigma_m * sigma_m), 1 / (sigma_m * sigma_m), 1 / (sigma_yaw_rad * sigma_yaw_rad))
      .asDiagonal();
}

// A square drive with drifting odometry, and its truth.
struct Square {
  std::vector<Pose2> truth, dead_reckoning;
  std::vector<Edge> edges;
};

Square make_square(unsigned seed, int per_side = 10) {
  std::mt19937_64 random(seed);
  const auto noise = [&](double sigma) {
    return sigma * (2.0 * static_cast<double>(random() >> 11) / 9007199254740992.0 - 1.0);
  };
  Square square;
  square.truth.push_back({0, 0, 0});
  for (int i = 1; i < 4 * per_side; ++i)
    square.truth.push_back(compose(square.truth.back(), {1.0, 0.0, i % per_side == 0 ? M_PI / 2 : 0.0}));
  square.dead_reckoning.push_back({0, 0, 0});
  for (std::size_t i = 1; i < square.truth.size(); ++i) {
    Pose2 step = between(square.truth[i - 1], square.truth[i]);
    step.x += 0.03 + noise(0.02);
    step.phi += 0.01 + noise(0.01);
    square.edges.push_back(
        {static_cast<std::uint32_t>(i - 1), static_cast<std::uint32_t>(i), step, information(0.05, 0.02), false});
    square.dead_reckoning.push_back(compose(square.dead_reckoning.back(), step));
  }
  return square;
}

Edge loop(const Square& square, std::uint32_t from, std::uint32_t to, const Pose2& error = {}) {
  return {from, to, compose(between(square.truth[from], square.truth[to]), error), information(0.02, 0.005), true};
}

double worst(const std::vector<Pose2>& a, const std::vector<Pose2>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::hypot(a[i].x - b[i].x, a[i].y - b[i].y));
  return most;
}

TEST(PoseGraph, closes_a_loop_and_takes_the_drift_out) {
  Square square = make_square(3);
  const double before = worst(square.dead_reckoning, square.truth);
  square.edges.push_back(loop(square, 0, 39));
  square.edges.push_back(loop(square, 2, 38));
  const Solution solution = solve(square.dead_reckoning, square.edges);
  EXPECT_TRUE(solution.converged);
  EXPECT_LT(worst(solution.poses, square.truth), 0.35 * before);
  EXPECT_THAT(between(solution.poses[0], solution.poses[39]),
              IsNear(between(square.truth[0], square.truth[39]), 0.05, 0.02));
}

TEST(PoseGraph, agrees_with_truth_exactly_when_edges_have_no_error) {
  const Square square = make_square(1);
  std::vector<Edge> edges;
  for (std::uint32_t i = 1; i < square.truth.size(); ++i)
    edges.push_back({i - 1, i, between(square.truth[i - 1], square.truth[i]), information(0.1, 0.1), false});
  edges.push_back(loop(square, 0, 39));
  const Solution solution = solve(square.dead_reckoning, edges, {100, 25.0, 10});
  EXPECT_LT(worst(solution.poses, square.truth), 1e-4);
  EXPECT_LT(solution.chi2, 1e-6);
}

TEST(PoseGraph, drops_a_false_loop_that_contradicts_true_ones) {
  Square square = make_square(5);
  square.edges.push_back(loop(square, 0, 39));
  square.edges.push_back(loop(square, 1, 38));
  square.edges.push_back(loop(square, 3, 37));
  square.edges.push_back(loop(square, 2, 38, {4.0, -3.0, 0.8}));
  const Solution solution = solve(square.dead_reckoning, square.edges);
  const std::size_t first = square.edges.size() - 4;
  EXPECT_EQ(solution.weight[first], 1.0);
  EXPECT_EQ(solution.weight[first + 1], 1.0);
  EXPECT_EQ(solution.weight[first + 2], 1.0);
  EXPECT_EQ(solution.weight[first + 3], 0.0);
}

TEST(PoseGraph, never_doubts_odometry) {
  Square square = make_square(7);
  square.edges.push_back(loop(square, 0, 39, {5.0, 0.0, 0.0}));
  const Solution solution = solve(square.dead_reckoning, square.edges);
  for (std::size_t i = 0; i + 1 < square.edges.size(); ++i) EXPECT_EQ(solution.weight[i], 1.0);
}

TEST(PoseGraph, moves_with_its_frame) {
  Square square = make_square(11);
  square.edges.push_back(loop(square, 0, 39));
  const Solution here = solve(square.dead_reckoning, square.edges);
  const Pose2 shift{12.0, -7.0, 1.1};
  std::vector<Pose2> moved;
  for (const auto& pose : square.dead_reckoning) moved.push_back(compose(shift, pose));
  const Solution there = solve(moved, square.edges);
  for (std::size_t i = 0; i < moved.size(); ++i)
    EXPECT_THAT(there.poses[i], IsNear(compose(shift, here.poses[i]), 1e-4, 1e-4));
}

TEST(PoseGraph, gives_the_same_bytes_twice) {
  Square square = make_square(13);
  square.edges.push_back(loop(square, 0, 39));
  square.edges.push_back(loop(square, 4, 30, {3.0, 3.0, 0.0}));
  const Solution one = solve(square.dead_reckoning, square.edges), two = solve(square.dead_reckoning, square.edges);
  for (std::size_t i = 0; i < one.poses.size(); ++i) {
    EXPECT_EQ(one.poses[i].x, two.poses[i].x);
    EXPECT_EQ(one.poses[i].phi, two.poses[i].phi);
  }
}

TEST(PoseGraph, refuses_edges_that_name_no_pose) {
  EXPECT_THROW(solve({{}, {}}, {{0, 2, {}, Eigen::Matrix3d::Identity(), false}}), ContractViolation);
  EXPECT_THROW(
      solve({{}, {}}, {{0, 1, {std::numeric_limits<double>::quiet_NaN(), 0, 0}, Eigen::Matrix3d::Identity(), false}}),
      ContractViolation);
}

TEST(PoseGraph, stands_directions_that_no_edge_knows) {
  Eigen::Matrix3d along = Eigen::Vector3d(0.0, 100.0, 100.0).asDiagonal();  // a corridor: nothing known lengthwise
  const Solution solution = solve({{0, 0, 0}, {1.3, 0.2, 0.1}}, {{0, 1, {1.0, 0.0, 0.0}, along, false}});
  EXPECT_NEAR(solution.poses[1].y, 0.0, 1e-3);
  EXPECT_TRUE(is_finite(solution.poses[1]));
}

TEST(MapOptimisation, removes_and_names_rejected_loops) {
  Square square = make_square(17);
  Map map;
  const SessionId session{{RobotId("alpha"), SensorId("laser")}, 1};
  const auto id = [&](std::uint32_t i) { return NodeId{session, i}; };
  for (std::uint32_t i = 0; i < square.truth.size(); ++i)
    map.nodes.set(id(i), Node{id(i), {static_cast<std::int64_t>(i)}, spatial(square.dead_reckoning[i]), nullptr});
  for (const auto& edge : square.edges) {
    const ConstraintId name{ConstraintKind::odometry, id(edge.from), id(edge.to), 0};
    map.constraints.set(name, planar_constraint(name, edge.from_from_to, edge.information));
  }
  for (const auto& [from, to, error] : {std::tuple{0U, 39U, 0.0}, {1U, 38U, 0.0}, {2U, 37U, 0.0}, {3U, 36U, 6.0}}) {
    const Edge edge = loop(square, from, to, {error, 0, 0});
    const ConstraintId name{ConstraintKind::loop, id(from), id(to), 0};
    map.constraints.set(name, planar_constraint(name, edge.from_from_to, edge.information));
  }
  const MapSolution solution = optimise(map);
  ASSERT_EQ(solution.rejected.size(), 1U);
  EXPECT_TRUE(solution.rejected.front().id.from == id(3));
  EXPECT_EQ(map.constraints.size(), square.edges.size() + 3);
  EXPECT_THAT(planar(map.nodes.front().second.map_from_node), IsNear(square.dead_reckoning[0], 1e-9, 1e-9));
}

}  // namespace
}  // namespace mapweave::graph
