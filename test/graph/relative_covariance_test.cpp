#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/graph/relative_covariance.h>
#include <mapweave/maps/alignment.h>

#include <Eigen/LU>

namespace mapweave::graph {
namespace {

Eigen::Matrix3d information(double sigma_m, double sigma_rad) {
  return Eigen::Vector3d(1 / (sigma_m * sigma_m), 1 / (sigma_m * sigma_m), 1 / (sigma_rad * sigma_rad)).asDiagonal();
}

// A drive around a square, each step 1 m.
struct Drive {
  std::vector<Pose2> poses{{0, 0, 0}};
  std::vector<Edge> edges;
  explicit Drive(std::uint32_t steps) {
    for (std::uint32_t i = 1; i < steps; ++i) {
      const Pose2 step{1.0, 0.0, i % 5 == 0 ? M_PI / 2 : 0.0};
      edges.push_back({i - 1, i, step, information(0.05, 0.01), false});
      poses.push_back(compose(poses.back(), step));
    }
  }
  RelativeCovariance covariance() const { return {poses, edges, std::vector<double>(edges.size(), 1.0)}; }
};

// Of all nodes as seen from the first, which is held, by a dense matrix.
Eigen::MatrixXd dense(const Drive& drive) {
  const auto size = static_cast<Eigen::Index>(3 * drive.poses.size());
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(size, size);
  for (const Edge& edge : drive.edges) {
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3, size);
    jacobian.middleCols<3>(3 * edge.from) = -adjoint(between(drive.poses[edge.to], drive.poses[edge.from]));
    jacobian.middleCols<3>(3 * edge.to) = Eigen::Matrix3d::Identity();
    all += jacobian.transpose() * edge.information * jacobian;
  }
  return all.bottomRightCorner(size - 3, size - 3).inverse();
}

TEST(RelativeCovariance, is_that_of_the_whole_matrix_inverted) {
  Drive drive(12);
  drive.edges.push_back({2, 11, between(drive.poses[2], drive.poses[11]), information(0.02, 0.005), true});
  const Eigen::MatrixXd expected = dense(drive);
  RelativeCovariance covariance = drive.covariance();
  for (std::uint32_t to = 1; to < 12; ++to) {
    const Eigen::Index place = 3 * (static_cast<Eigen::Index>(to) - 1);
    EXPECT_TRUE(covariance.between(0, to).isApprox(expected.block<3, 3>(place, place), 1e-5)) << to;
  }
}

TEST(RelativeCovariance, grows_along_a_drive_and_shrinks_where_a_loop_is_closed) {
  Drive drive(21);
  const double open = drive.covariance().between(0, 20)(0, 0);
  EXPECT_GT(open, drive.covariance().between(0, 5)(0, 0));
  drive.edges.push_back({0, 20, between(drive.poses[0], drive.poses[20]), information(0.01, 0.002), true});
  EXPECT_LT(drive.covariance().between(0, 20)(0, 0), 1.1e-4);
  EXPECT_LT(drive.covariance().between(0, 10)(0, 0), open);
}

TEST(RelativeCovariance, does_not_depend_on_where_the_graph_lies) {
  Drive drive(9), moved(9);
  for (Pose2& pose : moved.poses) pose = compose({100.0, -40.0, 2.0}, pose);
  RelativeCovariance here = drive.covariance(), there = moved.covariance();
  EXPECT_TRUE(here.between(3, 7).isApprox(there.between(3, 7), 1e-4));
  EXPECT_TRUE(here.between(4, 4).isZero());
}

TEST(RelativeCovariance, leaves_out_edges_without_weight) {
  Drive drive(6);
  drive.edges.push_back({0, 5, between(drive.poses[0], drive.poses[5]), information(0.001, 0.001), true});
  std::vector<double> weights(drive.edges.size(), 1.0);
  weights.back() = 0.0;
  RelativeCovariance rejected(drive.poses, drive.edges, weights), believed = drive.covariance();
  EXPECT_GT(rejected.between(0, 5)(0, 0), 100.0 * believed.between(0, 5)(0, 0));
  EXPECT_THROW((RelativeCovariance{drive.poses, drive.edges, {1.0}}), ContractViolation);
}

}  // namespace
}  // namespace mapweave::graph
