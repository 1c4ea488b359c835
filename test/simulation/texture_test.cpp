#include <mapweave/simulation/texture.h>

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

namespace mapweave::simulation {
namespace {

TEST(Texture, lies_between_its_texels) {
  const Texture texture(2, 2, {0, 100, 200, 100});
  EXPECT_EQ(texture.sample(0, 2.5f, 2.5f), 0);
  EXPECT_EQ(texture.sample(0, 3.5f, 2.5f), 100 * 256);
  EXPECT_EQ(texture.sample(0, 3.0f, 2.5f), 50 * 256);
  EXPECT_EQ(texture.sample(0, 2.5f, 3.0f), 100 * 256);
  EXPECT_EQ(texture.sample(0, 2.0f, 2.5f), 50 * 256) << "it repeats";
}

TEST(Texture, is_reduced_by_means) {
  const Texture texture(4, 2, {0, 100, 50, 50, 200, 100, 50, 50});
  ASSERT_EQ(texture.levels(), 2);
  EXPECT_EQ(texture.sample(1, 1.0f, 1.0f), 100 * 256);
  EXPECT_EQ(texture.sample(1, 3.0f, 1.0f), 50 * 256);
}

TEST(Canvas, paints_the_same_from_the_same_numbers_and_only_inside_of_the_area) {
  const auto painted = [](std::uint64_t seed) {
    Canvas canvas(256, 64, 0.01);
    RandomNumbers numbers(seed);
    canvas.add_shapes({0.5, 0.1, 1.0, 0.4}, 0.1, 1.0, 50, numbers);
    canvas.add_grain({0.5, 0.1, 1.0, 0.4}, 4.0, numbers);
    return canvas.take();
  };
  const auto texels = painted(1);
  EXPECT_EQ(painted(1), texels);
  EXPECT_NE(painted(2), texels);
  for (int row = 0; row < 64; ++row) {
    for (int column = 0; column < 256; ++column) {
      const bool is_inside = column >= 50 && column < 150 && row >= 10 && row < 50;
      EXPECT_TRUE(is_inside || texels[static_cast<std::size_t>(row * 256 + column)] == 128) << row << ' ' << column;
    }
  }
}

TEST(Canvas, grains_with_the_wanted_deviation) {
  Canvas canvas(256, 256, 0.01);
  RandomNumbers numbers(3);
  canvas.add_grain({0.0, 0.0, 2.56, 2.56}, 5.0, numbers);
  double sum = 0.0, squares = 0.0;
  for (const int texel : canvas.take()) {
    sum += texel - 128;
    squares += (texel - 128) * (texel - 128);
  }
  EXPECT_NEAR(sum / 65536, 0.0, 0.1);
  EXPECT_NEAR(std::sqrt(squares / 65536), 5.0, 0.15);
}

}  // namespace
}  // namespace mapweave::simulation
