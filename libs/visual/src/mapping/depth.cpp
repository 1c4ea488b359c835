#include "depth.h"

#include <algorithm>
#include <cmath>

namespace mapweave::visual {
namespace {

// Around a pixel: depths farther apart than this share are an edge, and what lies there may be of either side.
constexpr int kAround = 2, kMostMissing = 6;
constexpr double kEdge = 0.03, kSigmasAtEdge = 5.0;
constexpr double kLeastDisparity_px = 1.0;  // of less, a fraction of a pixel changes the depth many times over
// Of the disparity that a landmark's depth says: the stretch of the row that is searched, as shares and in pixels more.
constexpr double kLeastShare = 0.7, kLargestShare = 1.4, kBeside_px = 5.0;

}  // namespace

DepthMeter::DepthMeter(const LandmarkMap& map, const Frame& frame, const Pyramid& left, const Motion& motion,
                       const ClientOptions& options)
    : map_(map), depth_(frame.depth), left_(left), motion_(motion), options_(options) {
  if (!frame.right.empty()) right_ = make_pyramid(frame.right);
}

std::optional<MeasuredDepth> DepthMeter::at(const Eigen::Vector2d& pixel, int level, double expected_m) const {
  return right_.levels.empty() ? reading(pixel) : disparity(pixel, level, expected_m);
}

std::optional<MeasuredDepth> DepthMeter::reading(const Eigen::Vector2d& pixel) const {
  const DepthImage& image = depth_.image;
  if (image.empty() || std::abs(depth_.delay_s) > kLongestInterval_s) return std::nullopt;
  Eigen::Vector3d ray = map_.camera.ray(pixel);
  ray += depth_.delay_s * motion_.rotation_per_s.cross(ray);
  if (ray.z() < kLeastForward) return std::nullopt;
  const Eigen::Vector2d there = depth_.distortion.distorted({ray.x() / ray.z(), ray.y() / ray.z()});
  const double column = there.x() * depth_.camera.fx + depth_.camera.cx,
               row = there.y() * depth_.camera.fy + depth_.camera.cy;
  if (!(column >= kAround && row >= kAround && column < image.width - kAround - 1 && row < image.height - kAround - 1))
    return std::nullopt;
  const int x = static_cast<int>(std::lround(column)), y = static_cast<int>(std::lround(row));
  const int middle = image.row(y)[x];
  if (middle == 0) return std::nullopt;
  int low = middle, high = middle, missing = 0;
  for (int v = -kAround; v <= kAround; ++v)
    for (int u = -kAround; u <= kAround; ++u) {
      const int value = image.row(y + v)[x + u];
      if (value == 0) {
        ++missing;
      } else {
        low = std::min(low, value);
        high = std::max(high, value);
      }
    }
  const double depth_m = middle * depth_.metres_per_unit;
  if (depth_m < options_.depth.min_depth_m || depth_m > options_.depth.max_depth_m) return std::nullopt;
  const bool smooth = missing <= kMostMissing && high - low < kEdge * middle;
  return MeasuredDepth{1.0 / depth_m, options_.depth.inverse_depth_sigma * (smooth ? 1.0 : kSigmasAtEdge), !smooth};
}

std::optional<MeasuredDepth> DepthMeter::disparity(const Eigen::Vector2d& pixel, int level, double expected_m) const {
  const auto patch = cut_patch(left_, pixel, level);
  if (!patch) return std::nullopt;
  const double focal_baseline = map_.camera.fx * map_.baseline_m;
  double low = kLeastDisparity_px, high = options_.depth.max_disparity * map_.camera.width;
  if (expected_m > 0.0) {
    const double expected = focal_baseline / expected_m;
    low = std::max(low, kLeastShare * expected - kBeside_px);
    high = std::min(high, kLargestShare * expected + kBeside_px);
  }
  const auto found = find_disparity(*patch, pixel, right_, low, high);
  if (!found) return std::nullopt;
  return MeasuredDepth{*found / focal_baseline, options_.tracking.sigma_px * (1 << level) / focal_baseline, false};
}

}  // namespace mapweave::visual
