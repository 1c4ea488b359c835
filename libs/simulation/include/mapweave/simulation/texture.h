#pragma once
// What surfaces look like: one channel between two colours, with its reductions (mip levels), repeating in both
// directions.

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

  Texture(const Texture&) = delete;
  Texture(Texture&&) = default;
  Texture& operator=(Texture&&) = default;

  struct Level {
    const std::uint8_t* texels;
    int mask_x, mask_y, log2_width;
    float scale;  // 256 / 2^level
    // Between the four texels around (u, v), in texels of level 0 (0 to 65536 or so, never negative); times 256.
    int sample(float u, float v) const {
      const int x = static_cast<int>(u * scale) - 128, y = static_cast<int>(v * scale) - 128;  // texels / 256
      const int column = (x >> 8) & mask_x, next_column = (column + 1) & mask_x;
      const std::uint8_t* row = texels + (static_cast<std::size_t>((y >> 8) & mask_y) << log2_width);
      const std::uint8_t* next_row = texels + (static_cast<std::size_t>(((y >> 8) + 1) & mask_y) << log2_width);
      const int fx = x & 255, fy = y & 255;
      const int above = (row[column] << 8) + (row[next_column] - row[column]) * fx;
      const int below = (next_row[column] << 8) + (next_row[next_column] - next_row[column]) * fx;
      return above + (((below - above) * fy) >> 8);
    }
  };
  const Level& level(int number) const { return levels_[static_cast<std::size_t>(number)]; }
  int sample(int number, float u, float v) const { return level(number).sample(u, v); }

 private:
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
  // Rectangles, discs and triangles of this size (halved to doubled) at random places, `share` of the area in all, each
  // by up to `contrast` lighter or darker than what it covers. Clipped to the area.
  void add_shapes(const Area&, double size_m, double share, int contrast, RandomNumbers&);
  void add_lines(const Area&, double step_m, double width_m, int change, bool is_upright);

 private:
  struct Limits {
    double low_x, high_x, low_y, high_y;  // metres
  };
  template <class Inside>
  void change(const Area& clip, const Limits& limits, int by, Inside&& inside);
  int width_, height_;
  double texel_m_;
  std::vector<std::uint8_t> texels_;
};

}  // namespace mapweave::simulation
