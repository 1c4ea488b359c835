#include "ceres_bundle.h"

#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/graph/bundle_adjustment.h>

#include <random>

namespace mapweave::graph {
namespace {

// Cameras on a ring look inwards at a ball of points.
struct Ring {
  Bundle truth, drifted;
  explicit Ring(int views = 24, int points = 300, bool depth = true, double noise_px = 0.0) {
    std::mt19937_64 random(3);
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
    };
    truth.cameras = {{640, 480, 500, 500, 320, 240}};
    for (int i = 0; i < views; ++i) {
      const double angle = 2.0 * M_PI * i / views;
      const Eigen::Quaterniond inwards =
          Eigen::Quaterniond(Eigen::AngleAxisd(-angle - M_PI / 2, Eigen::Vector3d::UnitY()));
      truth.views.push_back({view_of({{4.0 * std::cos(angle), 0.0, 4.0 * std::sin(angle)}, inwards}), 0, i == 0});
    }
    for (int i = 0; i < points; ++i) truth.points.push_back({uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)});
    for (std::uint32_t p = 0; p < truth.points.size(); ++p)
      for (std::uint32_t v = 0; v < truth.views.size(); ++v) {
        const Eigen::Vector3d in_camera = truth.views[v].view * truth.points[p];
        if (in_camera.z() < 0.5) continue;
        BundleSighting seen;
        seen.view = v;
        seen.point = p;
        seen.sigma_px = 0.5;
        seen.pixel = {500 * in_camera.x() / in_camera.z() + 320 + noise_px * uniform(-1, 1),
                      500 * in_camera.y() / in_camera.z() + 240 + noise_px * uniform(-1, 1)};
        if (depth) {
          seen.inverse_depth = 1.0 / in_camera.z();
          seen.inverse_depth_sigma = 0.005;
        }
        truth.sightings.push_back(seen);
      }
    drifted = truth;
    for (std::size_t i = 1; i < drifted.views.size(); ++i) {
      Pose3 pose = pose_of(drifted.views[i].view);
      pose.t += 0.004 * static_cast<double>(i) * Eigen::Vector3d(1, 0.5, -0.3);
      pose.q = pose.q * Eigen::Quaterniond(Eigen::AngleAxisd(0.002 * static_cast<double>(i),
                                                             Eigen::Vector3d(0.3, 1, 0.2).normalized()));
      drifted.views[i].view = view_of(pose);
    }
    for (auto& point : drifted.points)
      point += Eigen::Vector3d(uniform(-0.05, 0.05), uniform(-0.05, 0.05), uniform(-0.05, 0.05));
  }
  double worst(const Bundle& bundle) const {
    double most = 0.0;
    for (std::size_t i = 0; i < bundle.views.size(); ++i)
      most = std::max(most, (bundle.views[i].view.centre() - truth.views[i].view.centre()).norm());
    return most;
  }
};

TEST(BundleAdjustment, comes_back_to_the_truth) {
  Ring ring;
  EXPECT_GT(ring.worst(ring.drifted), 0.08);
  const BundleReport report = adjust(ring.drifted);
  EXPECT_LT(report.cost_after, 1e-6 * report.cost_before);
  EXPECT_LT(ring.worst(ring.drifted), 1e-4);
  for (std::size_t i = 0; i < ring.truth.points.size(); ++i)
    EXPECT_LT((ring.drifted.points[i] - ring.truth.points[i]).norm(), 1e-4);
}

TEST(BundleAdjustment, leaves_out_what_is_wrong) {
  Ring ring(24, 300, true, 0.2);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < ring.drifted.sightings.size(); i += 20, ++wrong)
    ring.drifted.sightings[i].pixel.x() += 60.0;
  adjust(ring.drifted);
  EXPECT_LT(ring.worst(ring.drifted), 0.02);
  for (std::size_t i = 0; i < ring.drifted.sightings.size(); i += 20) wrong -= ring.drifted.sightings[i].fits ? 0 : 1;
  EXPECT_EQ(wrong, 0U);
}

TEST(BundleAdjustment, ends_where_ceres_does) {
  for (const bool depth : {true, false}) {
    Ring ring(24, 300, depth, 3.0);
    ring.drifted.views[1].fixed = true;  // for the scale
    ring.drifted.views[1].view = ring.truth.views[1].view;
    for (std::size_t i = 0; i < ring.drifted.sightings.size(); i += 50) ring.drifted.sightings[i].pixel.y() += 8.0;
    Bundle other = ring.drifted;
    BundleOptions options;
    options.iterations = 60;
    options.least_gain = 1e-12;
    const BundleReport ours = adjust(ring.drifted, options),
                       theirs = adjust_by_ceres(other, options, ceres::DENSE_SCHUR);
    EXPECT_NEAR(ours.cost_before, theirs.cost_before, 1e-9 * theirs.cost_before);
    EXPECT_NEAR(ours.cost_after, theirs.cost_after, 1e-6 * theirs.cost_after);
    for (std::size_t i = 0; i < other.views.size(); ++i)
      EXPECT_LT((ring.drifted.views[i].view.centre() - other.views[i].view.centre()).norm(), 1e-4);
  }
}

TEST(BundleAdjustment, holds_views_together_by_relative_pose_constraints) {
  Ring ring;
  // A view that sees nothing, on a rig with another.
  ring.drifted.views.push_back(ring.drifted.views[5]);
  const Pose3 rig{{0.1, 0.2, 0.0}, Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()))};
  ring.drifted.relative_poses.push_back({5, 24, rig, 1e-3, 1e-3});
  adjust(ring.drifted);
  const Pose3 there = between(pose_of(ring.drifted.views[5].view), pose_of(ring.drifted.views[24].view));
  EXPECT_LT((there.t - rig.t).norm(), 1e-3);
  EXPECT_LT(there.q.angularDistance(rig.q), 1e-3);
  ring.drifted.views.pop_back();
  EXPECT_LT(ring.worst(ring.drifted), 1e-3);
}

// Rows are read downwards while the cameras move, each its own path.
void move_while_reading(Bundle& bundle, double readout_s) {
  for (BundleSighting& seen : bundle.sightings) {
    const double columns_per_s = seen.view % 2 == 0 ? 200.0 : -150.0;
    seen.row_flow = (seen.pixel.y() / 480.0 - 0.5) * Eigen::Vector2d(columns_per_s, 40.0 + 10.0 * (seen.view % 5));
    seen.pixel += readout_s * seen.row_flow;
  }
}

TEST(BundleAdjustment, learns_how_long_rows_are_read) {
  Ring ring;
  move_while_reading(ring.drifted, 0.02);
  BundleOptions options;
  options.iterations = 40;
  options.prior.readout_step_s = 0.05;
  options.prior.readout_s = 1.0;
  adjust(ring.drifted, options);
  EXPECT_NEAR(ring.drifted.calibration.readout_s, 0.02, 2e-4);
  EXPECT_EQ(ring.drifted.calibration.inverse_depth_offset, 0.0);  // was not to be learnt
  EXPECT_LT(ring.worst(ring.drifted), 1e-3);
}

TEST(BundleAdjustment, learns_a_constant_error_of_disparities) {
  Ring ring;
  for (BundleSighting& seen : ring.drifted.sightings) seen.inverse_depth += 0.01;
  BundleOptions options;
  options.iterations = 60;
  options.least_gain = 1e-9;
  options.prior.inverse_depth_step = 0.1;
  options.prior.inverse_depth = 1.0;
  adjust(ring.drifted, options);
  EXPECT_NEAR(ring.drifted.calibration.inverse_depth_offset, 0.01, 1e-3);
  EXPECT_EQ(ring.drifted.calibration.readout_s, 0.0);
}

TEST(BundleAdjustment, leaves_fixed_views_and_points_alone) {
  Ring ring;
  const Bundle before = ring.drifted;
  for (BundleView& view : ring.drifted.views) view.fixed = true;
  ring.drifted.fixed_points.assign(ring.drifted.points.size(), 0);
  ring.drifted.fixed_points[7] = 1;
  adjust(ring.drifted);
  for (std::size_t i = 0; i < before.views.size(); ++i) {
    EXPECT_EQ(ring.drifted.views[i].view.rotation, before.views[i].view.rotation);
    EXPECT_EQ(ring.drifted.views[i].view.translation, before.views[i].view.translation);
  }
  EXPECT_EQ(ring.drifted.points[7], before.points[7]);
  EXPECT_NE(ring.drifted.points[8], before.points[8]);
}

// Landmarks that others share hold a window that no view of its own holds.
TEST(BundleAdjustment, is_held_by_points_that_are_fixed) {
  Ring ring;
  ring.drifted.points = ring.truth.points;
  ring.drifted.fixed_points.assign(ring.truth.points.size(), 1);
  ring.drifted.views.front().fixed = false;
  ring.drifted.views.front().view.translation.x() += 0.05;
  adjust(ring.drifted);
  EXPECT_LT(ring.worst(ring.drifted), 1e-4);
  EXPECT_EQ(ring.drifted.points, ring.truth.points);
}

TEST(BundleAdjustment, refuses_what_names_nothing) {
  Ring ring(4, 10);
  ring.drifted.sightings.front().view = 99;
  EXPECT_THROW(adjust(ring.drifted), ContractViolation);
  Ring other(4, 10);
  other.drifted.relative_poses.push_back({0, 77, {}, 1.0, 1.0});
  EXPECT_THROW(adjust(other.drifted), ContractViolation);
}

}  // namespace
}  // namespace mapweave::graph
