#pragma once
// Landmarks of other maps looked for in a keyframe's picture, where the keyframe would see them.

#include "visual_map.h"

namespace mapweave::fusion {

constexpr double kSameDepth = 0.1;  // of the distance

struct SoughtLandmark {
  std::size_t landmark = 0;  // the caller's number
  Eigen::Vector2d pixel;     // where it is expected
  double depth_m = 0.0;      // there
  const BinaryDescriptor* descriptor = nullptr;
};

// Features of a picture by their places in it; made once for any number of searches.
class FeaturesByPlace {
 public:
  // scale: of the team over that of the keyframe's map.
  FeaturesByPlace(const MappedKeyframe& keyframe, double scale);

  struct Shown {
    std::size_t feature, landmark;
  };
  // By rising feature; each shows the landmark that is most like it.
  std::vector<Shown> find(const std::vector<SoughtLandmark>& sought, double radius_px) const;

 private:
  struct Feature {
    double u_px, v_px, depth_m;  // depth 0: unknown
    std::uint32_t number;
  };
  struct Nearest {
    int bits;  // that differ; many: none is near
    std::size_t feature;
  };
  Nearest nearest_to(const SoughtLandmark& sought, double radius_px) const;

  const MappedKeyframe* keyframe_;
  int columns_ = 1, rows_ = 1;
  std::vector<std::uint32_t> begin_;  // in features_, of each cell, and the end
  std::vector<Feature> features_;
};

}  // namespace mapweave::fusion
