#pragma once
// Pictures halved again and again.

#include <mapweave/visual/frame.h>

namespace mapweave::visual {

inline constexpr int kLevels = 5;  // of half the size each: 640 pixels across become 40

class FrameFeatureGrid;

struct Pyramid {
  std::vector<GreyImage> levels;  // the first is the picture itself; a pixel of level l covers 2^l x 2^l of it
  std::shared_ptr<const FrameFeatureGrid> features;  // of a sensor that hands over features: then there are no levels
  const GreyImage& operator[](int level) const { return levels[static_cast<std::size_t>(level)]; }
};

Pyramid make_pyramid(GreyImage picture);

// A place of level 0 seen at another level, and back: pixel centres, so halves count.
inline double at_level(double coordinate, int level) { return (coordinate + 0.5) / (1 << level) - 0.5; }
inline double from_level(double coordinate, int level) { return (coordinate + 0.5) * (1 << level) - 0.5; }

// Bilinear; (x, y) must lie within [0, width - 1) x [0, height - 1).
inline float sample(const GreyImage& image, float x, float y) {
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
  const std::uint8_t* p = image.row(iy) + ix;
  const std::uint8_t* q = p + image.width;
  const float upper = static_cast<float>(p[0]) + fx * static_cast<float>(p[1] - p[0]);
  const float lower = static_cast<float>(q[0]) + fx * static_cast<float>(q[1] - q[0]);
  return upper + fy * (lower - upper);
}

}  // namespace mapweave::visual
