#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/matching/feature_matching.h>

#include <map>
#include <random>

namespace mapweave::matching {
namespace {

// Squares of all sizes and greys, `shift_px` to the right.
struct Picture {
  static constexpr int kWidth = 320, kHeight = 240;
  std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(kWidth * kHeight, 128);
  explicit Picture(int shift_px) {
    std::mt19937_64 random(8);
    for (int i = 0; i < 150; ++i) {
      const int x = static_cast<int>(random() % 280) + shift_px, y = static_cast<int>(random() % 200),
                size = 4 + static_cast<int>(random() % 25);
      const auto grey = static_cast<std::uint8_t>(random());
      for (int v = y; v < std::min(kHeight, y + size); ++v)
        for (int u = x; u < std::min(kWidth, x + size); ++u) pixels[static_cast<std::size_t>(v * kWidth + u)] = grey;
    }
  }
  PictureView view() const { return {pixels.data(), kWidth, kHeight, kWidth}; }
};

TEST(OrbFeatures, move_with_the_picture) {
  const Picture still(0), moved(7);
  const OrbFeatures a = orb_features(still.view()), b = orb_features(moved.view());
  ASSERT_GT(a.points.size(), 150U);
  ASSERT_EQ(a.points.size(), a.descriptors.size());
  const auto matches = match_features(view_of(a), view_of(b));
  ASSERT_GT(matches.size(), 60U);
  std::size_t right = 0;
  for (const FeatureMatch& match : matches)
    right += std::abs(b.points[match.b].u_px - a.points[match.a].u_px - 7.0f) < 2.0f &&
             std::abs(b.points[match.b].v_px - a.points[match.a].v_px) < 2.0f;
  EXPECT_GT(right * 10, matches.size() * 9);
}

TEST(OrbFeatures, come_in_one_order_and_the_same_again) {
  const Picture picture(0);
  const OrbFeatures first = orb_features(picture.view()), second = orb_features(picture.view());
  EXPECT_EQ(first.descriptors, second.descriptors);
  for (std::size_t i = 1; i < first.points.size(); ++i) {
    const auto key = [](const FeaturePoint& point) { return std::make_tuple(point.level, point.v_px, point.u_px); };
    EXPECT_LE(key(first.points[i - 1]), key(first.points[i]));
  }
  OrbFeatureOptions few;
  few.features = 50;
  EXPECT_LE(orb_features(picture.view(), few).points.size(), 60U);
}

TEST(OrbFeatures, are_none_on_a_blank_picture_and_need_pixels) {
  const std::vector<std::uint8_t> grey(100 * 100, 90);
  EXPECT_TRUE(orb_features({grey.data(), 100, 100, 100}).points.empty());
  EXPECT_TRUE(orb_features({grey.data(), 5, 5, 5}).points.empty());
  EXPECT_THROW(orb_features({grey.data(), 0, 100, 0}), ContractViolation);
}

}  // namespace
}  // namespace mapweave::matching
