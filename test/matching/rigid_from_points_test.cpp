#include <gtest/gtest.h>
#include <mapweave/matching/rigid_from_points.h>

#include <random>

namespace mapweave::matching {
namespace {

class Draws {
 public:
  explicit Draws(std::uint64_t seed) : random_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53;
  }
  Eigen::Vector3d point(double reach) {
    return {uniform(-reach, reach), uniform(-reach, reach), uniform(-reach, reach)};
  }
  Pose3 pose(double reach) {
    return {point(reach),
            Eigen::Quaterniond(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized()};
  }

 private:
  std::mt19937_64 random_;
};

Eigen::Vector3d moved(const Sim3& a_from_b, const Eigen::Vector3d& point) {
  return a_from_b.scale * (a_from_b.pose.q * point) + a_from_b.pose.t;
}

TEST(AlignPoints, recovers_pose_and_scale_exactly) {
  Draws draws(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Sim3 truth{draws.pose(10.0), draws.uniform(0.05, 20.0)};
    const Sim3 rigid_truth{truth.pose, 1.0};
    std::vector<PointPair> similar, rigid;
    for (int i = 0; i < 3 + trial % 5; ++i) {
      const Eigen::Vector3d b = draws.point(5.0);
      similar.push_back({moved(truth, b), b, draws.uniform(0.1, 3.0)});
      rigid.push_back({moved(rigid_truth, b), b, draws.uniform(0.1, 3.0)});
    }
    const auto found = align_points(similar, Freedom::similarity), found_rigid = align_points(rigid, Freedom::rigid);
    ASSERT_TRUE(found && found_rigid);
    EXPECT_NEAR(found->scale, truth.scale, 1e-9 * truth.scale);
    EXPECT_LT(found->pose.q.angularDistance(truth.pose.q), 1e-7);
    EXPECT_LT((found->pose.t - truth.pose.t).norm(), 1e-8);
    EXPECT_EQ(found_rigid->scale, 1.0);
    EXPECT_LT((found_rigid->pose.t - truth.pose.t).norm(), 1e-8);
  }
}

TEST(AlignPoints, is_of_least_squares) {
  Draws draws(2);
  std::vector<PointPair> pairs;
  for (int i = 0; i < 12; ++i) pairs.push_back({draws.point(3.0), draws.point(3.0), draws.uniform(0.5, 2.0)});
  const auto cost = [&](const Sim3& a_from_b) {
    double sum = 0.0;
    for (const PointPair& pair : pairs) sum += pair.weight * (pair.in_a - moved(a_from_b, pair.in_b)).squaredNorm();
    return sum;
  };
  const auto best = align_points(pairs, Freedom::rigid);
  ASSERT_TRUE(best);
  for (int trial = 0; trial < 200; ++trial) {
    Sim3 other = *best;
    other.pose.t += draws.point(0.01);
    other.pose.q = (other.pose.q * Eigen::Quaterniond(1.0, draws.uniform(-0.01, 0.01), draws.uniform(-0.01, 0.01),
                                                      draws.uniform(-0.01, 0.01)))
                       .normalized();
    EXPECT_GE(cost(other), cost(*best));
  }
}

TEST(AlignPoints, refuses_what_does_not_determine_the_rotation) {
  const Eigen::Vector3d nowhere(std::nan(""), 0, 0);
  const std::vector<Eigen::Vector3d> line = {{0, 0, 0}, {1, 2, 3}, {2, 4, 6}, {-3, -6, -9}};
  const std::vector<Eigen::Vector3d> one_place(4, Eigen::Vector3d(1, 2, 3));
  const std::vector<Eigen::Vector3d> two = {{0, 0, 0}, {1, 0, 0}};
  const std::vector<Eigen::Vector3d> broken = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, nowhere};
  for (const Freedom freedom : {Freedom::rigid, Freedom::similarity}) {
    for (const auto& points : {line, one_place, two, broken, {}}) {
      std::vector<PointPair> pairs;
      for (const auto& point : points) pairs.push_back({point, point, 1.0});
      EXPECT_FALSE(align_points(pairs, freedom));
    }
  }
}

TEST(PosesFromThreePoints, contain_the_truth_and_all_explain_the_rays) {
  Draws draws(3);
  int missed = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Pose3 camera_from_world = draws.pose(5.0);
    std::array<Eigen::Vector3d, 3> rays, points;
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3d in_camera(draws.uniform(-2, 2), draws.uniform(-2, 2), draws.uniform(1, 6));
      rays[i] = in_camera.normalized();
      points[i] = transformed(in_camera, inverse(camera_from_world));
    }
    double least = 1e9;
    const auto poses = poses_from_three_points(rays, points);
    EXPECT_LE(poses.size(), 4U);
    for (const Pose3& pose : poses) {
      least = std::min(least, (pose.t - camera_from_world.t).norm() + pose.q.angularDistance(camera_from_world.q));
      for (std::size_t i = 0; i < 3; ++i) EXPECT_LT((transformed(points[i], pose).normalized() - rays[i]).norm(), 1e-5);
    }
    missed += least > 1e-4;
  }
  EXPECT_LE(missed, 4);  // on the danger cylinder, where two poses fall together
}

TEST(PosesFromThreePoints, are_none_for_points_or_rays_in_a_line) {
  const std::array<Eigen::Vector3d, 3> rays = {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0.1, 0, 1).normalized(),
                                               Eigen::Vector3d(0, 0.1, 1).normalized()};
  EXPECT_TRUE(
      poses_from_three_points(rays, {Eigen::Vector3d(0, 0, 2), Eigen::Vector3d(1, 0, 2), Eigen::Vector3d(2, 0, 2)})
          .empty());
  EXPECT_TRUE(
      poses_from_three_points(rays, {Eigen::Vector3d(1, 1, 2), Eigen::Vector3d(1, 1, 2), Eigen::Vector3d(1, 1, 2)})
          .empty());
  EXPECT_TRUE(poses_from_three_points({rays[0], rays[0], rays[1]},
                                      {Eigen::Vector3d(0, 0, 2), Eigen::Vector3d(1, 0, 2), Eigen::Vector3d(0, 1, 2)})
                  .empty());
  const double nan = std::nan("");
  EXPECT_TRUE(
      poses_from_three_points(rays, {Eigen::Vector3d(nan, 0, 2), Eigen::Vector3d(1, 0, 2), Eigen::Vector3d(0, 1, 2)})
          .empty());
}

}  // namespace
}  // namespace mapweave::matching
