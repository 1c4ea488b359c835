#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/evaluation/alignment.h>
#include <support/pose_matchers.h>

namespace mapweave::evaluation {
namespace {

// Numbers in [-1, 1) from a seed, the same everywhere.
double scattered(std::uint64_t& seed) {
  seed = seed * 6364136223846793005u + 1442695040888963407u;
  return static_cast<double>(seed >> 11) * 0x1p-52 - 1.0;
}

// `estimate` seen through `reference_from_estimate`, plus noise.
std::vector<PosePair> pairs_under(const Sim3& reference_from_estimate, double noise_m, bool flat, std::uint64_t seed) {
  std::vector<PosePair> pairs;
  for (int i = 0; i < 30; ++i) {
    PosePair pair;
    pair.stamp.ns = i;
    pair.estimate.t = Eigen::Vector3d(5.0 * scattered(seed), 3.0 * scattered(seed), flat ? 0.0 : 2.0 * scattered(seed));
    pair.reference = transformed(pair.estimate, reference_from_estimate);
    const Eigen::Vector3d noise(scattered(seed), scattered(seed), flat ? 0.0 : scattered(seed));
    pair.reference.t += noise_m * noise;
    pairs.push_back(pair);
  }
  return pairs;
}

double squared_distances(const std::vector<PosePair>& pairs, const Sim3& motion) {
  double sum = 0.0;
  for (const auto& pair : pairs) sum += (pair.reference.t - transformed(pair.estimate, motion).t).squaredNorm();
  return sum;
}

Sim3 motion_of(double scale) {
  Sim3 motion;
  motion.pose.t = {3.0, -1.0, 0.5};
  motion.pose.q = Eigen::AngleAxisd(2.5, Eigen::Vector3d(0.2, -0.4, 0.8).normalized());
  motion.scale = scale;
  return motion;
}

TEST(Alignment, finds_the_motion_that_made_the_reference) {
  for (const double scale : {1.0, 0.3, 4.0}) {
    const Sim3 truth = motion_of(scale);
    const Sim3 found = reference_from_estimate(pairs_under(truth, 0.0, false, 1),
                                               scale == 1.0 ? AlignmentKind::se3 : AlignmentKind::sim3);
    EXPECT_NEAR((found.pose.t - truth.pose.t).norm(), 0.0, 1e-9);
    EXPECT_NEAR(found.pose.q.angularDistance(truth.pose.q), 0.0, 1e-9);
    EXPECT_NEAR(found.scale, scale, 1e-9);
  }
}

TEST(Alignment, se3_of_a_flat_trajectory_is_a_rotation_and_no_mirror) {
  const auto pairs = pairs_under(motion_of(1.0), 0.1, true, 2);
  const Sim3 found = reference_from_estimate(pairs, AlignmentKind::se3);
  EXPECT_NEAR(found.pose.q.toRotationMatrix().determinant(), 1.0, 1e-12);
  EXPECT_LT(found.pose.q.angularDistance(motion_of(1.0).pose.q), 0.1);
}

// Brute force: no small change of the answer in any direction lays the trajectories closer.
TEST(Alignment, cannot_be_bettered_by_a_small_change) {
  for (const auto kind : {AlignmentKind::se2, AlignmentKind::se3, AlignmentKind::sim3}) {
    const auto pairs = pairs_under(motion_of(kind == AlignmentKind::sim3 ? 1.7 : 1.0), 0.3, false, 3);
    const Sim3 found = reference_from_estimate(pairs, kind);
    const double best = squared_distances(pairs, found);
    for (int axis = 0; axis < 7; ++axis) {
      const bool allowed =
          kind == AlignmentKind::sim3 || (kind == AlignmentKind::se3 && axis < 6) || axis < 2 || axis == 5;
      if (!allowed) continue;
      for (const double step : {-1e-4, 1e-4}) {
        Sim3 other = found;
        if (axis < 3) other.pose.t(axis) += step;
        if (axis >= 3 && axis < 6)
          other.pose.q = Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(axis - 3)) * other.pose.q;
        if (axis == 6) other.scale += step;
        EXPECT_GE(squared_distances(pairs, other), best) << "axis " << axis;
      }
    }
  }
}

// Brute force over yaw: the best translation for a yaw is that of the means.
TEST(Alignment, se2_finds_the_best_yaw_of_all) {
  Sim3 truth;
  truth.pose = spatial(Pose2(1.0, 2.0, -2.8));
  const auto pairs = pairs_under(truth, 0.5, true, 4);
  Eigen::Vector3d reference_mean = Eigen::Vector3d::Zero(), estimate_mean = Eigen::Vector3d::Zero();
  for (const auto& pair : pairs) {
    reference_mean += pair.reference.t / 30.0;
    estimate_mean += pair.estimate.t / 30.0;
  }
  double best = 1e300, best_yaw = 0.0;
  for (int i = 0; i < 3600; ++i) {
    Sim3 candidate;
    candidate.pose.q = Eigen::AngleAxisd(i * M_PI / 1800.0, Eigen::Vector3d::UnitZ());
    candidate.pose.t = reference_mean - candidate.pose.q * estimate_mean;
    const double sum = squared_distances(pairs, candidate);
    if (sum < best) {
      best = sum;
      best_yaw = i * M_PI / 1800.0;
    }
  }
  const Sim3 found = reference_from_estimate(pairs, AlignmentKind::se2);
  EXPECT_LE(squared_distances(pairs, found), best + 1e-12);
  EXPECT_NEAR(wrap_angle(planar(found.pose).phi - best_yaw), 0.0, M_PI / 1800.0);
}

TEST(Alignment, se2_leaves_heights_and_tilt_alone) {
  const Sim3 found = reference_from_estimate(pairs_under(motion_of(1.0), 0.0, false, 5), AlignmentKind::se2);
  EXPECT_DOUBLE_EQ(found.pose.t.z(), 0.0);
  EXPECT_DOUBLE_EQ(found.pose.q.x(), 0.0);
  EXPECT_DOUBLE_EQ(found.pose.q.y(), 0.0);
  EXPECT_DOUBLE_EQ(found.scale, 1.0);
}

TEST(Alignment, none_changes_nothing) {
  const Sim3 found = reference_from_estimate(pairs_under(motion_of(2.0), 0.0, false, 5), AlignmentKind::none);
  EXPECT_EQ(found.pose.t, Eigen::Vector3d::Zero());
  EXPECT_DOUBLE_EQ(found.scale, 1.0);
}

TEST(Alignment, refuses_positions_that_do_not_determine_it) {
  std::vector<PosePair> line(5), point(5);
  for (int i = 0; i < 5; ++i)
    line[static_cast<std::size_t>(i)].estimate.t = line[static_cast<std::size_t>(i)].reference.t =
        Eigen::Vector3d(i, 0.0, 0.0);
  EXPECT_THROW(reference_from_estimate(line, AlignmentKind::se3), Error);
  EXPECT_THROW(reference_from_estimate(line, AlignmentKind::sim3), Error);
  EXPECT_NO_THROW(reference_from_estimate(line, AlignmentKind::se2));
  EXPECT_THROW(reference_from_estimate(point, AlignmentKind::se2), Error);
  EXPECT_THROW(reference_from_estimate({PosePair{}}, AlignmentKind::se2), Error);
  EXPECT_THROW(reference_from_estimate({}, AlignmentKind::se2), ContractViolation);
}

TEST(Association, takes_the_nearest_in_time_for_each_of_the_shorter) {
  Trajectory longer, shorter;
  for (int i = 0; i < 10; ++i) longer.push_back({Stamp{i * 100000000}, spatial(Pose2(i, 0.0, 0.0))});
  shorter = {{Stamp{109000000}, {}}, {Stamp{150000000}, {}}, {Stamp{909000000}, {}}};
  const auto pairs = associated(shorter, longer, 0.01);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_DOUBLE_EQ(pairs[0].reference.t.x(), 1.0);
  EXPECT_DOUBLE_EQ(pairs[1].reference.t.x(), 9.0);
  EXPECT_EQ(pairs[0].stamp, Stamp{109000000});

  const auto swapped = associated(longer, shorter, 0.01);
  ASSERT_EQ(swapped.size(), 2u);
  EXPECT_DOUBLE_EQ(swapped[0].estimate.t.x(), 1.0);
  EXPECT_EQ(swapped[0].stamp, Stamp{100000000});
}

TEST(ConstantRotation, of_a_robot_against_its_cameras_optical_frame_is_found) {
  std::vector<PosePair> pairs;
  for (int i = 0; i < 20; ++i) {
    const Pose3 robot{{0.1 * i, 0.0, 0.0}, Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitZ()))};
    pairs.push_back({Stamp{i}, compose(robot, robot_from_optical()), robot});
  }
  const auto found = constant_rotation(pairs);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->angle_deg, 120.0, 1e-6);
  EXPECT_NEAR(found->spread_deg, 0.0, 1e-5);
  EXPECT_NEAR(found->reference_body_from_estimate_body.angularDistance(robot_from_optical().q.conjugate()), 0.0, 1e-6);
}

TEST(ConstantRotation, is_not_made_of_errors) {
  std::vector<PosePair> pairs;
  for (int i = 0; i < 20; ++i)
    pairs.push_back({Stamp{i}, {}, {{}, Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitZ()))}});
  EXPECT_FALSE(constant_rotation(pairs));  // a heading that runs away
  EXPECT_FALSE(constant_rotation({{Stamp{0}, {}, {}}}));
}

TEST(ConstantRotation, is_not_made_of_a_world_that_is_turned) {
  // A hand-held camera that stays in place: positions say little of how the worlds lie to each other.
  const Eigen::Quaterniond world(Eigen::AngleAxisd(0.37, Eigen::Vector3d(1.0, 2.0, 0.5).normalized()));
  std::vector<PosePair> pairs;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Quaterniond q = Eigen::AngleAxisd(0.1 * std::sin(0.3 * i), Eigen::Vector3d::UnitX()) *
                                 Eigen::AngleAxisd(0.1 * std::cos(0.2 * i), Eigen::Vector3d::UnitY()) *
                                 Eigen::Quaterniond::Identity();
    pairs.push_back({Stamp{i}, {Eigen::Vector3d::Zero(), world * q}, {Eigen::Vector3d::Zero(), q}});
  }
  EXPECT_FALSE(constant_rotation(pairs));
}

TEST(RobotFromOptical, looks_ahead) {
  EXPECT_NEAR((robot_from_optical().q * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 0.0, 1e-12);
  EXPECT_NEAR((robot_from_optical().q * Eigen::Vector3d::UnitY() + Eigen::Vector3d::UnitZ()).norm(), 0.0, 1e-12);
}

}  // namespace
}  // namespace mapweave::evaluation
