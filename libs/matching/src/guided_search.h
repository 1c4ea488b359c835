#pragma once
// Landmarks of one side looked for where an alignment expects them in a picture of the other.

#include <mapweave/matching/visual_judge.h>

#include <optional>

namespace mapweave::matching {

// Features of a keyframe by place in the picture. `keyframe` must outlive it.
class KeyframeFeatureGrid {
 public:
  explicit KeyframeFeatureGrid(const KeyframeView& keyframe);
  const KeyframeView& keyframe() const { return keyframe_; }
  // Calls take(feature) for each within the radius, rising within a cell.
  template <class Take>
  void near(const Eigen::Vector2d& pixel, double radius_px, Take&& take) const {
    const int x0 = cell(pixel.x() - radius_px, columns_), x1 = cell(pixel.x() + radius_px, columns_);
    const int y0 = cell(pixel.y() - radius_px, rows_), y1 = cell(pixel.y() + radius_px, rows_);
    for (int y = y0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x) {
        const auto place = static_cast<std::size_t>(y * columns_ + x);
        for (std::uint32_t i = begin_[place]; i < begin_[place + 1]; ++i) {
          const FeaturePoint& point = keyframe_.features.points[order_[i]];
          const double du = point.u_px - pixel.x(), dv = point.v_px - pixel.y();
          if (du * du + dv * dv <= radius_px * radius_px) take(order_[i]);
        }
      }
  }

 private:
  static constexpr double kCell = 24.0;  // pixels
  static int cell(double pixel, int count) {
    return static_cast<int>(std::min(std::max(0.0, pixel / kCell), static_cast<double>(count - 1)));
  }
  const KeyframeView& keyframe_;
  int columns_ = 1, rows_ = 1;
  std::vector<std::uint32_t> begin_, order_;
};

struct GuidedSearch {
  struct Found {
    std::uint32_t landmark, feature;  // of the one side, of the other's picture
    int distance;
  };
  std::vector<Found> found;  // by rising landmark; a feature once
  int expected = 0;          // landmarks in view
  int seen_through = 0;      // of them, those in front of what the picture's side sees there
};

// camera_from_side: of the landmarks' side. depth_of_feature: of the grid's keyframe, along its axis, 0 unknown, in the
// unit of camera_from_side; may be empty.
GuidedSearch search_landmarks(const std::vector<LandmarkView>& landmarks, const Sim3& camera_from_side,
                              const KeyframeFeatureGrid& grid, const std::vector<double>& depth_of_feature,
                              double radius_px, int max_distance);

}  // namespace mapweave::matching
