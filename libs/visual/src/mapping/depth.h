#pragma once
// How far away is what a pixel shows? From a depth camera, or from the right picture of a stereo pair.

#include "geometry/motion.h"
#include "landmark_map.h"

#include <optional>

namespace mapweave::visual {

struct MeasuredDepth {
  double inverse_depth = 0.0, sigma = 0.0;  // 1/m
  bool at_edge = false;                     // where something near ends: it may be of either side
  double depth_m() const { return 1.0 / inverse_depth; }
};

// Of one frame.
class DepthMeter {
 public:
  // The pictures must outlive it. `motion`: the depth picture may have been taken earlier or later than the other.
  DepthMeter(const LandmarkMap& map, const Frame& frame, const Pyramid& left, const Motion& motion,
             const ClientOptions& options);
  // Of a corner; `expected_m` 0: anywhere. nullopt where there is no reading, or none that can be trusted.
  std::optional<MeasuredDepth> at(const Eigen::Vector2d& pixel, int level, double expected_m = 0.0) const;
  // Quick, from the depth camera alone.
  std::optional<MeasuredDepth> reading(const Eigen::Vector2d& pixel) const;

 private:
  std::optional<MeasuredDepth> disparity(const Eigen::Vector2d& pixel, int level, double expected_m) const;
  const LandmarkMap& map_;
  const DepthPicture& depth_;
  const Pyramid& left_;
  Pyramid right_;
  Motion motion_;
  ClientOptions options_;
};

}  // namespace mapweave::visual
