#include "mono/two_views.h"

#include <gtest/gtest.h>
#include <random>

namespace mapweave::visual {
namespace {

const Pinhole camera{640, 480, 500.0, 500.0, 319.5, 239.5};

View motion_of(double x, double y, double z, double turn) {
  Eigen::Matrix<double, 6, 1> motion;
  motion << x, y, z, 0.1 * turn, turn, 0.3 * turn;
  return moved(View(), motion);
}

class Uniform {
 public:
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1.0p-53;
  }

 private:
  std::mt19937_64 random_{11};
};

enum class World { room, wall };

std::vector<PixelPair> seen_from(const View& second, World world, double noise_px, int wrong) {
  Uniform uniform;
  std::vector<PixelPair> pairs;
  while (pairs.size() < 150) {
    const Eigen::Vector2d pixel(uniform(20, 620), uniform(20, 460));
    const Eigen::Vector3d ray = camera.ray(pixel);
    const double depth = world == World::room ? uniform(2.0, 6.0) : 3.0 / (1.0 + 0.5 * ray.x() - 0.2 * ray.y());
    const Eigen::Vector3d there = second * (ray * depth);
    if (there.z() < 0.1) continue;
    const auto noise = [&] { return Eigen::Vector2d(uniform(-noise_px, noise_px), uniform(-noise_px, noise_px)); };
    pairs.push_back({pixel + noise(), camera.project(there) + noise(), 0.5});
  }
  for (int i = 0; i < wrong; ++i)
    pairs[static_cast<std::size_t>(4 * i)].second += Eigen::Vector2d(uniform(15, 40), uniform(-40, -15));
  return pairs;
}

void expect_motion(const TwoViews& found, const View& truth, double tolerance_rad) {
  EXPECT_LT(Eigen::AngleAxisd(found.second_from_first.rotation.transpose() * truth.rotation).angle(), tolerance_rad);
  EXPECT_LT(std::acos(std::min(1.0, found.second_from_first.translation.dot(truth.translation.normalized()))),
            10.0 * tolerance_rad);
}

TEST(TwoViews, finds_motion_and_points_of_a_room) {
  const View truth = motion_of(0.3, 0.05, 0.1, 0.04);
  const auto found = relate_views(seen_from(truth, World::room, 0.0, 0), camera, {});
  ASSERT_TRUE(found);
  expect_motion(*found, truth, 1e-4);
  EXPECT_EQ(found->count, 150);
  for (const Eigen::Vector3d& point : found->points) {
    const double depth = point.z() * truth.translation.norm();
    EXPECT_GT(depth, 1.99);
    EXPECT_LT(depth, 6.01);
  }
}

TEST(TwoViews, is_not_led_astray_by_wrong_pairs) {
  const View truth = motion_of(0.3, -0.05, 0.2, -0.05);
  const auto found = relate_views(seen_from(truth, World::room, 0.4, 30), camera, {});
  ASSERT_TRUE(found);
  expect_motion(*found, truth, 0.006);
  for (std::size_t i = 0; i < 30; ++i) EXPECT_FALSE(found->fits[4 * i]);
}

TEST(TwoViews, sees_forward_motion) {
  const View truth = motion_of(0.02, 0.01, -0.8, 0.01);
  const auto found = relate_views(seen_from(truth, World::room, 0.3, 10), camera, {});
  ASSERT_TRUE(found);
  expect_motion(*found, truth, 0.004);
}

TEST(TwoViews, is_right_or_silent_before_a_wall) {
  int answers = 0;
  for (int i = 0; i < 8; ++i) {
    const View truth = motion_of(0.5 * std::cos(0.8 * i), 0.5 * std::sin(0.8 * i), 0.15, 0.03 * (i % 3));
    const auto found = relate_views(seen_from(truth, World::wall, 0.2, 0), camera, {});
    if (!found) continue;
    ++answers;
    expect_motion(*found, truth, 0.02);
  }
  EXPECT_GT(answers, 0);
}

TEST(TwoViews, waits_while_the_camera_only_turns) {
  EXPECT_FALSE(relate_views(seen_from(motion_of(0, 0, 0, 0.1), World::room, 0.4, 0), camera, {}));
  EXPECT_FALSE(relate_views(seen_from(motion_of(0.01, 0, 0, 0.1), World::room, 0.4, 0), camera, {}));
}

TEST(TwoViews, needs_pairs_that_agree) {
  EXPECT_FALSE(relate_views({}, camera, {}));
  auto pairs = seen_from(motion_of(0.3, 0, 0, 0), World::room, 0.0, 0);
  Uniform uniform;
  for (PixelPair& pair : pairs) pair.second = {uniform(0, 639), uniform(0, 479)};
  EXPECT_FALSE(relate_views(pairs, camera, {}));
}

TEST(TwoViews, answers_alike_every_time) {
  const auto pairs = seen_from(motion_of(0.3, 0.05, 0.1, 0.04), World::room, 0.4, 20);
  const auto one = relate_views(pairs, camera, {}), other = relate_views(pairs, camera, {});
  ASSERT_TRUE(one && other);
  EXPECT_EQ(one->second_from_first.rotation, other->second_from_first.rotation);
  EXPECT_EQ(one->points, other->points);
}

// Tracks that all stick to one thing, or to two.
TEST(TwoViews, are_none_of_pairs_that_are_one_pair) {
  std::vector<PixelPair> pairs(100, {{100.0, 120.0}, {110.0, 121.0}, 0.5});
  EXPECT_FALSE(relate_views(pairs, camera, {}));
  for (std::size_t i = 0; i < 50; ++i) pairs[i] = {{400.0, 300.0}, {404.0, 309.0}, 0.5};
  EXPECT_FALSE(relate_views(pairs, camera, {}));
  for (std::size_t i = 0; i < 100; ++i)
    pairs[i] = {{6.0 * static_cast<double>(i), 50.0}, {6.0 * static_cast<double>(i) + 9.0, 50.0}, 0.5};
  EXPECT_FALSE(relate_views(pairs, camera, {}));
}

}  // namespace
}  // namespace mapweave::visual
