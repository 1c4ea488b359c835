#include "geometry/bundle.h"

#include <gtest/gtest.h>
#include <random>

namespace mapweave::visual {
namespace {

const Pinhole camera{640, 480, 500.0, 500.0, 319.5, 239.5};
constexpr double kReadout = 0.02;

// Views along a line that look at points ahead; exact sightings.
WindowBundle known_world(bool with_flow, double depth_offset) {
  std::mt19937_64 random(7);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
  };
  WindowBundle bundle;
  for (int i = 0; i < 6; ++i) {
    Eigen::Matrix<double, 6, 1> motion;
    motion << 0.15 * i, 0.02 * i, 0.01 * i, 0.01 * i, -0.03 * i, 0.02 * i;
    bundle.views.push_back(moved(View(), motion));
    bundle.fixed.push_back(i == 0);
  }
  for (int p = 0; p < 80; ++p) bundle.points.emplace_back(uniform(-2, 2), uniform(-1.5, 1.5), uniform(2, 6));
  for (int p = 0; p < 80; ++p)
    for (int v = 0; v < 6; ++v) {
      const Eigen::Vector3d seen =
          bundle.views[static_cast<std::size_t>(v)] * bundle.points[static_cast<std::size_t>(p)];
      WindowBundleObservation o;
      o.view = v;
      o.point = p;
      o.sighting.pixel = camera.project(seen);
      if (with_flow) {
        o.sighting.row_flow =
            (o.sighting.pixel.y() / 480.0 - 0.5) * Eigen::Vector2d(uniform(-300, 300), 200.0 + 40.0 * v);
        o.sighting.pixel += kReadout * o.sighting.row_flow;
      }
      o.sighting.inverse_depth = 1.0 / seen.z() + depth_offset;
      o.sighting.inverse_depth_sigma = 0.005;
      bundle.observations.push_back(o);
    }
  return bundle;
}

void disturb(WindowBundle& bundle) {
  for (std::size_t i = 1; i < bundle.views.size(); ++i) {
    Eigen::Matrix<double, 6, 1> motion;
    motion << 0.03, -0.02, 0.02, 0.01, -0.01, 0.01;
    bundle.views[i] = moved(bundle.views[i], (i % 2 == 0 ? 1.0 : -1.0) * motion);
  }
  for (std::size_t i = 0; i < bundle.points.size(); ++i)
    bundle.points[i] += Eigen::Vector3d(0.05, -0.04, i % 3 == 0 ? 0.1 : -0.08);
}

void expect_truth(const WindowBundle& found, const WindowBundle& truth, double tolerance) {
  for (std::size_t i = 0; i < truth.views.size(); ++i) {
    EXPECT_LT((found.views[i].centre() - truth.views[i].centre()).norm(), tolerance);
    EXPECT_TRUE(found.views[i].rotation.isApprox(truth.views[i].rotation, tolerance));
  }
  for (std::size_t i = 0; i < truth.points.size(); ++i)
    EXPECT_LT((found.points[i] - truth.points[i]).norm(), 10.0 * tolerance);
}

TEST(WindowBundle, comes_back_to_the_truth) {
  const WindowBundle truth = known_world(false, 0.0);
  WindowBundle bundle = truth;
  disturb(bundle);
  adjust(bundle, camera, {30, 2.0, 4.0, {}});
  expect_truth(bundle, truth, 1e-5);
}

TEST(WindowBundle, does_not_believe_wrong_sightings) {
  const WindowBundle truth = known_world(false, 0.0);
  WindowBundle bundle = truth;
  disturb(bundle);
  for (std::size_t i = 0; i < bundle.observations.size(); i += 17) bundle.observations[i].sighting.pixel.x() += 60.0;
  adjust(bundle, camera, {40, 2.0, 4.0, {}});
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) EXPECT_EQ(bundle.observations[i].fits, i % 17 != 0) << i;
  expect_truth(bundle, truth, 0.01);
}

TEST(WindowBundle, learns_how_long_rows_are_read) {
  const WindowBundle truth = known_world(true, 0.0);
  WindowBundle bundle = truth;
  disturb(bundle);
  WindowBundleOptions options{40, 2.0, 4.0, {}};
  options.prior.readout_step_s = 0.05;
  options.prior.readout_s = 1.0;
  adjust(bundle, camera, options);
  EXPECT_NEAR(bundle.calibration.readout_s, kReadout, 2e-4);
  EXPECT_NEAR(bundle.calibration.inverse_depth_offset, 0.0, 1e-20);  // was not to be learnt
}

TEST(WindowBundle, learns_a_constant_error_of_disparities) {
  const WindowBundle truth = known_world(false, 0.01);
  WindowBundle bundle = truth;
  disturb(bundle);
  WindowBundleOptions options{60, 2.0, 4.0, {}};
  options.prior.inverse_depth_step = 0.1;
  options.prior.inverse_depth = 1.0;
  adjust(bundle, camera, options);
  EXPECT_NEAR(bundle.calibration.inverse_depth_offset, 0.01, 1e-3);
}

TEST(WindowBundle, leaves_fixed_views_alone) {
  WindowBundle bundle = known_world(false, 0.0);
  disturb(bundle);
  std::fill(bundle.fixed.begin(), bundle.fixed.end(), 1);
  const auto views = bundle.views;
  adjust(bundle, camera, {});
  for (std::size_t i = 0; i < views.size(); ++i) EXPECT_EQ(bundle.views[i].rotation, views[i].rotation);
}

TEST(PoseFromPoints, finds_the_view_among_a_third_of_wrong_sightings) {
  const WindowBundle world = known_world(false, 0.0);
  std::vector<Sighting> sightings;
  for (const WindowBundleObservation& o : world.observations) {
    if (o.view != 4) continue;
    sightings.push_back(o.sighting);
    sightings.back().point_in_map = world.points[static_cast<std::size_t>(o.point)];
    sightings.back().inverse_depth_sigma = 0.0;
    if (o.point % 3 == 0) sightings.back().pixel += Eigen::Vector2d(40.0, -25.0);
  }
  const PoseFromPoints found = pose_from_points(sightings, camera, world.views[3], {}, 4.0);
  EXPECT_LT((found.view.centre() - world.views[4].centre()).norm(), 0.01);
  EXPECT_EQ(found.count, static_cast<int>(sightings.size() - (sightings.size() + 2) / 3));
}

TEST(WindowBundle, is_the_same_sparse_as_dense) {
  // A long walk: more views than the dense solver takes, each point seen by four of them.
  std::mt19937_64 random(3);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
  };
  WindowBundle truth;
  for (int i = 0; i < 70; ++i) {
    Eigen::Matrix<double, 6, 1> motion = Eigen::Matrix<double, 6, 1>::Zero();
    motion << -0.2 * i, 0, 0, 0.01 * (i % 3), 0.01 * (i % 5), 0;
    truth.views.push_back(moved(View(), motion));
    truth.fixed.push_back(i == 0);
  }
  for (int i = 0; i < 67; ++i)
    for (int p = 0; p < 12; ++p) {
      truth.points.emplace_back(0.2 * i + uniform(-0.5, 1.0), uniform(-1, 1), uniform(2, 4));
      for (int v = i; v < i + 4; ++v) {
        WindowBundleObservation o;
        o.view = v;
        o.point = static_cast<int>(truth.points.size()) - 1;
        const Eigen::Vector3d seen = truth.views[static_cast<std::size_t>(v)] * truth.points.back();
        o.sighting.pixel = camera.project(seen);
        o.sighting.inverse_depth = 1.0 / seen.z();
        o.sighting.inverse_depth_sigma = 0.005;
        truth.observations.push_back(o);
      }
    }
  WindowBundle bundle = truth;
  disturb(bundle);
  adjust(bundle, camera, {40, 2.0, 4.0, {}});
  expect_truth(bundle, truth, 1e-4);
}

}  // namespace
}  // namespace mapweave::visual
