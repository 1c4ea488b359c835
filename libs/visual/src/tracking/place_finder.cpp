#include "place_finder.h"

#include <mapweave/matching/alignment_search.h>

namespace mapweave::visual {
namespace {

constexpr int kMostBits = 70;            // of 256, in which descriptors of one landmark differ
constexpr double kClearlyNearer = 0.85;  // than the second nearest (Lowe's test)
constexpr int kLeastFeatures = 12;       // that agree on a pose

Eigen::Vector2d pixel_of(const matching::FeaturePoint& point) {
  return {static_cast<double>(point.u_px), static_cast<double>(point.v_px)};
}
double sigma_of(const matching::FeaturePoint& point) { return 1.2 * std::pow(1.2, point.level); }

}  // namespace

matching::OrbFeatures features_of(const Pyramid& pictures, int most) {
  // Places are known again by coarse features; of a wide picture the finest are not worth their time.
  constexpr int kWide_px = 800, kLevelsOfHalf = 4;  // 1.2^4 is about 2
  const bool half = pictures[0].width > kWide_px;
  const GreyImage& picture = pictures[half ? 1 : 0];
  matching::OrbFeatureOptions options;
  options.features = most;
  if (half) options.levels -= kLevelsOfHalf;
  matching::OrbFeatures features = matching::orb_features(
      {picture.pixels.data(), picture.width, picture.height, static_cast<std::size_t>(picture.width)}, options);
  if (!half) return features;
  for (matching::FeaturePoint& point : features.points) {
    point.u_px = static_cast<float>(from_level(static_cast<double>(point.u_px), 1));
    point.v_px = static_cast<float>(from_level(static_cast<double>(point.v_px), 1));
    point.level = static_cast<std::uint8_t>(point.level + kLevelsOfHalf);
  }
  return features;
}

std::optional<View> find_place(const LandmarkMap& map, const std::vector<int>& keyframes,
                               const matching::OrbFeatures& features, std::uint64_t seed) {
  matching::AlignmentProblem problem;
  const Pinhole& pinhole = map.camera;
  problem.cameras_b.push_back({pinhole, Pose3()});
  for (int number : keyframes) {
    const Keyframe& keyframe = map.keyframe(number);
    const View map_from_camera = keyframe.view.inverse();
    problem.cameras_a.push_back({pinhole, pose_of(keyframe.view)});
    for (std::size_t i = 0; i < keyframe.features.points.size(); ++i) {
      if (!(keyframe.depths[i] > 0.0F)) continue;
      const auto there = matching::nearest_descriptors(keyframe.features.descriptors[i], features.descriptors.data(),
                                                       features.descriptors.size());
      if (there.distance > kMostBits || there.distance > kClearlyNearer * there.second_distance) continue;
      const auto back =
          matching::nearest_descriptors(features.descriptors[there.first], keyframe.features.descriptors.data(),
                                        keyframe.features.descriptors.size());
      if (back.first != i) continue;
      matching::FeaturePair pair;
      pair.camera_a = static_cast<std::uint32_t>(problem.cameras_a.size() - 1);
      pair.pixel_a = pixel_of(keyframe.features.points[i]);
      pair.sigma_a_px = sigma_of(keyframe.features.points[i]);
      pair.pixel_b = pixel_of(features.points[there.first]);
      pair.sigma_b_px = sigma_of(features.points[there.first]);
      pair.point_in_a = map_from_camera * (map.camera.ray(pair.pixel_a) * static_cast<double>(keyframe.depths[i]));
      problem.pairs.push_back(pair);
    }
  }
  matching::AlignmentOptions options;
  options.least_inliers = kLeastFeatures;
  options.seed = seed;
  const auto fit = matching::search_alignment(problem, options);
  if (!fit) return std::nullopt;
  return view_of(fit->a_from_b.pose);
}

}  // namespace mapweave::visual
