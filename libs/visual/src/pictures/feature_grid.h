#pragma once
// A frame's features by where they are.

#include <mapweave/visual/frame.h>

namespace mapweave::visual {

inline constexpr int kMostBits = 60;             // in which a landmark may differ from how it was seen
inline constexpr double kClearlyNearest = 0.85;  // the next best may not differ in less than this share more

class FrameFeatureGrid {
 public:
  // Features outside the picture are left out.
  FrameFeatureGrid(const FeatureFrame& frame, const Pinhole& camera);
  const matching::OrbFeatures& features() const { return features_; }
  int size() const { return static_cast<int>(features_.points.size()); }
  Eigen::Vector2d pixel(int feature) const;
  double inverse_depth(int feature) const {
    return static_cast<double>(inverse_depths_[static_cast<std::size_t>(feature)]);
  }  // 0: none
  // Of a pyramid of halves, as pictures have: the one whose pixels are about as large.
  int level(int feature) const;
  // What looks like that within `radius`, clearly more than anything else there; -1: nothing. `taken` are left out.
  int find(const matching::OrbDescriptor& descriptor, const Eigen::Vector2d& pixel, double radius,
           const std::vector<char>& taken) const;

 private:
  matching::OrbFeatures features_;
  std::vector<float> inverse_depths_;
  double level_factor_;
  int columns_ = 0, rows_ = 0;
  std::vector<int> first_, members_;  // cell by cell
};

// Of features without depths.
FrameFeatureGrid grid_of(const matching::OrbFeatures& features, const Pinhole& camera);

}  // namespace mapweave::visual
