#include <mapweave/core/error.h>
#include <mapweave/graph/spatial_graph.h>

#include <gtest/gtest.h>

namespace mapweave::graph {
namespace {

// A ring of poses that climbs and turns, and comes back to where it began.
std::vector<Pose3> ring(int count) {
  std::vector<Pose3> poses;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.0 * M_PI * i / count;
    poses.push_back({{3.0 * std::cos(angle), 3.0 * std::sin(angle), 0.4 * std::sin(2.0 * angle)},
                     Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())) *
                         Eigen::Quaterniond(Eigen::AngleAxisd(0.3 * std::sin(angle), Eigen::Vector3d::UnitX()))});
  }
  return poses;
}

SpatialEdge edge_of(const std::vector<Pose3>& poses, std::uint32_t from, std::uint32_t to) {
  return {from, to, between(poses[from], poses[to]), 100.0 * Eigen::Matrix<double, 6, 6>::Identity()};
}

TEST(SpatialGraph, comes_back_to_the_truth_from_drifted_poses) {
  const auto truth = ring(40);
  std::vector<SpatialEdge> edges;
  for (std::uint32_t i = 0; i + 1 < truth.size(); ++i) edges.push_back(edge_of(truth, i, i + 1));
  edges.push_back(edge_of(truth, 39, 0));
  auto drifted = truth;
  for (std::size_t i = 1; i < drifted.size(); ++i) {
    drifted[i].t += 0.02 * static_cast<double>(i) * Eigen::Vector3d(1.0, -0.5, 0.3);
    drifted[i].q = drifted[i].q * Eigen::Quaterniond(Eigen::AngleAxisd(0.01 * static_cast<double>(i),
                                                                       Eigen::Vector3d(0.2, 0.3, 1.0).normalized()));
  }
  const SpatialSolution solution = solve(drifted, edges);
  EXPECT_TRUE(solution.converged);
  EXPECT_LT(solution.chi2, 1e-6);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_LT((solution.poses[i].t - truth[i].t).norm(), 1e-4);
    EXPECT_LT(solution.poses[i].q.angularDistance(truth[i].q), 1e-4);
  }
}

TEST(SpatialGraph, spreads_the_gap_of_a_loop_evenly) {
  // A straight path of ten steps, each measured 1 m; the loop says that the end is 10.5 m away.
  std::vector<Pose3> poses(11);
  std::vector<SpatialEdge> edges;
  for (std::uint32_t i = 0; i < 10; ++i) {
    poses[i + 1].t.x() = i + 1.0;
    edges.push_back(edge_of(poses, i, i + 1));
  }
  edges.push_back(
      {0, 10, {{10.5, 0, 0}, Eigen::Quaterniond::Identity()}, 1e6 * Eigen::Matrix<double, 6, 6>::Identity()});
  const SpatialSolution solution = solve(poses, edges);
  for (std::size_t i = 0; i <= 10; ++i) EXPECT_NEAR(solution.poses[i].t.x(), 1.05 * static_cast<double>(i), 1e-3);
}

TEST(SpatialGraph, keeps_poses_that_no_edge_names) {
  std::vector<Pose3> poses = ring(4);
  const SpatialSolution solution = solve(poses, std::vector<SpatialEdge>());
  EXPECT_TRUE(solution.converged);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(solution.poses[i].t, poses[i].t);
  EXPECT_THROW(
      solve(poses, std::vector<SpatialEdge>{edge_of(poses, 0, 1), {0, 9, {}, Eigen::Matrix<double, 6, 6>::Identity()}}),
      ContractViolation);
}

TEST(SpatialGraph, computes_the_squared_error_of_an_edge) {
  const std::vector<Pose3> poses = ring(4);
  SpatialEdge edge = edge_of(poses, 0, 1);
  EXPECT_NEAR(chi2_of(edge, poses), 0.0, 1e-12);
  edge.from_from_to = compose(edge.from_from_to, Pose3{{0.1, 0, 0}, Eigen::Quaterniond::Identity()});
  EXPECT_NEAR(chi2_of(edge, poses), 100.0 * 0.01, 1e-9);
}

// The ring as one camera would map it: its scale shrinks along the path.
TEST(SpatialGraph, corrects_a_ring_whose_scale_drifted) {
  const auto truth = ring(40);
  std::vector<Sim3> drifted{{truth[0], 1.0}};
  std::vector<SimilarityEdge> edges;
  double scale = 1.0;
  for (std::uint32_t i = 0; i + 1 < truth.size(); ++i) {
    Pose3 step = between(truth[i], truth[i + 1]);
    step.t *= scale;
    drifted.push_back({compose(drifted.back().pose, step), 1.0});
    edges.push_back({i, i + 1, {step, 1.0}});
    scale *= 0.99;
  }
  // The loop knows the last pose in the first one's scale, and the ratio of the two.
  SimilarityEdge loop{0, 39, {between(truth[0], truth[39]), 1.0 / scale}};
  loop.information *= 1e4;
  edges.push_back(loop);
  const SimilaritySolution solution = solve(drifted, edges);
  EXPECT_TRUE(solution.converged);
  double before = 0, after = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    before = std::max(before, (drifted[i].pose.t - truth[i].t).norm());
    after = std::max(after, (solution.poses[i].pose.t - truth[i].t).norm());
  }
  EXPECT_GT(before, 0.8);
  EXPECT_LT(after, 0.1 * before);
  EXPECT_NEAR(solution.poses[39].scale, 1.0 / scale, 0.01);
  EXPECT_NEAR(solution.poses[20].scale, std::sqrt(1.0 / scale), 0.02);
}

TEST(SpatialGraph, refuses_scales_that_are_none) {
  const std::vector<Sim3> poses(2);
  EXPECT_THROW(solve(poses, std::vector<SimilarityEdge>{{0, 1, {Pose3(), 0.0}}}), ContractViolation);
  EXPECT_THROW(solve(std::vector<Sim3>{{Pose3(), 1.0}, {Pose3(), -1.0}}, std::vector<SimilarityEdge>{{0, 1, {}}}),
               ContractViolation);
}

}  // namespace
}  // namespace mapweave::graph
