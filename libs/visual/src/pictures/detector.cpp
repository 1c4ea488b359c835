#include "detector.h"

#include <cmath>
#include <opencv2/features2d.hpp>

namespace mapweave::visual {
namespace {

constexpr int kHalf = 4, kBorder = 14;  // pixels of a corner's window, and that a patch and its warp need

// Shi and Tomasi, CVPR 1994.
double strength_at(const GreyImage& image, int cx, int cy) {
  float xx = 0, yy = 0, xy = 0;
  for (int y = cy - kHalf; y < cy + kHalf; ++y) {
    const std::uint8_t* p = image.row(y);
    for (int x = cx - kHalf; x < cx + kHalf; ++x) {
      const float gx = 0.5F * static_cast<float>(p[x + 1] - p[x - 1]);
      const float gy = 0.5F * static_cast<float>(p[x + image.width] - p[x - image.width]);
      xx += gx * gx;
      yy += gy * gy;
      xy += gx * gy;
    }
  }
  const float n = 4.0F * kHalf * kHalf;
  xx /= n;
  yy /= n;
  xy /= n;
  return static_cast<double>(0.5F * (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4.0F * xy * xy)));
}

}  // namespace

std::vector<Corner> detect_corners(const Pyramid& pyramid, const std::vector<Eigen::Vector2d>& occupied,
                                   const DetectorOptions& options) {
  const int columns = (pyramid[0].width + options.cell_px - 1) / options.cell_px,
            rows = (pyramid[0].height + options.cell_px - 1) / options.cell_px;
  const auto cell_of = [&](double x, double y) {
    return static_cast<std::size_t>(static_cast<int>(y) / options.cell_px * columns +
                                    static_cast<int>(x) / options.cell_px);
  };
  std::vector<char> taken(static_cast<std::size_t>(columns * rows), 0);
  for (const Eigen::Vector2d& pixel : occupied)
    if (pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < pyramid[0].width && pixel.y() < pyramid[0].height)
      taken[cell_of(pixel.x(), pixel.y())] = 1;
  std::vector<Corner> best(taken.size());
  std::vector<cv::KeyPoint> found;
  for (int level = 0; level < options.levels; ++level) {
    const GreyImage& image = pyramid[level];
    const cv::Mat picture(image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data()));
    cv::FAST(picture, found, options.threshold, true);
    for (const cv::KeyPoint& point : found) {
      const int x = static_cast<int>(point.pt.x), y = static_cast<int>(point.pt.y);
      if (x < kBorder || y < kBorder || x >= image.width - kBorder || y >= image.height - kBorder) continue;
      const Eigen::Vector2d pixel(from_level(x, level), from_level(y, level));
      const std::size_t cell = cell_of(pixel.x(), pixel.y());
      if (taken[cell]) continue;
      const double strength = strength_at(image, x, y);
      if (strength > options.min_strength && strength > best[cell].strength) best[cell] = {pixel, level, strength};
    }
  }
  std::vector<Corner> result;
  for (const Corner& corner : best)
    if (corner.strength > 0.0) result.push_back(corner);
  return result;
}

}  // namespace mapweave::visual
