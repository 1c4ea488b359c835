#include "geometry/pose_from_points.h"

#include <gtest/gtest.h>
#include <random>

namespace mapweave::visual {
namespace {

TEST(PoseFromPoints, finds_the_view_among_a_third_of_wrong_sightings) {
  const Pinhole camera{640, 480, 500.0, 500.0, 319.5, 239.5};
  std::mt19937_64 random(7);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
  };
  Eigen::Matrix<double, 6, 1> motion;
  motion << 0.6, 0.08, 0.04, 0.04, -0.12, 0.08;
  const View view = moved(View(), motion), guess = moved(View(), 0.75 * motion);
  std::vector<Sighting> sightings;
  for (int i = 0; i < 80; ++i) {
    Sighting seen;
    seen.point_in_map = {uniform(-2, 2), uniform(-1.5, 1.5), uniform(2, 6)};
    seen.pixel = camera.project(view * seen.point_in_map);
    if (i % 3 == 0) seen.pixel += Eigen::Vector2d(40.0, -25.0);
    sightings.push_back(seen);
  }
  const PoseFromPoints found = pose_from_points(sightings, camera, guess, {}, 4.0);
  EXPECT_LT((found.view.centre() - view.centre()).norm(), 0.01);
  EXPECT_EQ(found.count, 53);
}

}  // namespace
}  // namespace mapweave::visual
