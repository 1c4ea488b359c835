#pragma once
// What surfaces look like: one channel between two colours, with its reductions (mip levels), repeating in both directions.

#include <mapweave/simulation/random.h>

#include <cstdint>
#include <vector>

namespace mapweave::simulation {

// Immutable; may be used by many threads.
class Texture {
 public:
  // Sizes are powers of two, 1 to 8192 texels; row by row.
  Texture(int width, int height, std::vector<std::uint8_t> texels);
  int width() const { return width_; }
  int height() const { return height_; }
  int levels() const { return static_cast<int>(levels_.size()); }

  // Between the four texels of a level around (u, v), in texels of level 0 (0 to 65536 or so, never negative); times 256.
  int sample(int level, float u, float v) const {
    const Level& at = levels_[static_cast<std::size_t>(level)];
    const int x = static_cast<int>(u * at.scale) - 128, y = static_cast<int>(v * at.scale) - 128;  // texels / 256
    const int column = (x >> 8) & at.mask_x, next_column = (column + 1) & at.mask_x;
    const std::uint8_t* row = texels_.data() + at.first + (static_cast<std::size_t>((y >> 8) & at.mask_y) << at.log2_width);
    const std::uint8_t* next_row = texels_.data() + at.first + (static_cast<std::size_t>(((y >> 8) + 1) & at.mask_y) << at.log2_width);
    const int fx = x & 255, fy = y & 255;
    const int above = row[column] * (256 - fx) + row[next_column] * fx, below = next_row[column] * (256 - fx) + next_row[next_column] * fx;
    return (above * (256 - fy) + below * fy) >> 8;
  }

 private:
  struct Level {
    std::size_t first;
    int mask_x, mask_y, log2_width;
    float scale;  // 256 / 2^level
  };
  int width_, height_;
  std::vector<Level> levels_;
  std::vector<std::uint8_t> texels_;  // of all levels
};

// A picture to be painted on, in metres from its upper left corner; it repeats in both directions.
class Canvas {
 public:
  Canvas(int width, int height, double texel_m);
  int width() const { return width_; }
  int height() const { return height_; }
  double texel_m() const { return texel_m_; }
  std::vector<std::uint8_t> take() { return std::move(texels_); }

  struct Area {
    double left_m, top_m, width_m, height_m;
  };
  void fill(const Area&, int value);
  void add_gradient(const Area&, int from_left, int to_right);
  void add_grain(const Area&, double sigma, RandomNumbers&);
  // Rectangles, discs and triangles of this size (halved to doubled) at random places, `share` of the area in all, each by up to
  // `contrast` lighter or darker than what it covers. Clipped to the area.
  void add_shapes(const Area&, double size_m, double share, int contrast, RandomNumbers&);
  void add_lines(const Area&, double step_m, double width_m, int change, bool is_upright);

 private:
  template <class Inside>
  void change(const Area& clip, double low_x, double high_x, double low_y, double high_y, int by, Inside&& inside);
  int width_, height_;
  double texel_m_;
  std::vector<std::uint8_t> texels_;
};

}  // namespace mapweave::simulation
