#include <mapweave/matching/landmark_description.h>

#include <algorithm>
#include <cmath>

namespace mapweave::matching {
namespace {

struct Look {
  OrbDescriptor descriptor{};
  Eigen::Vector3d feature_from_point = Eigen::Vector3d::Zero();
  bool has_feature = false;
};

// A feature beside the sighting, at the landmark's depth; of several the nearest in pixels of its level.
Look look_of(const KeyframeFeatures& keyframe, const LandmarkSighting& sighting, const Pose3& map_from_camera, double depth_m,
             double reach_px) {
  const CameraGeometry& camera = *keyframe.geometry;
  const int u = sighting.u, v = sighting.v, far = static_cast<int>(std::min(16.0 * reach_px / kPixelUnit_px, 65536.0));
  Look look;
  double best = reach_px;
  for (std::size_t i = 0; i < keyframe.points.size(); ++i) {
    const KeyframePoint& point = keyframe.points[i];
    if (std::abs(point.v - v) > far || std::abs(point.u - u) > far) continue;
    const double du = kPixelUnit_px * (point.u - u), dv = kPixelUnit_px * (point.v - v);
    const double apart = std::hypot(du, dv) / std::pow(camera.level_scale, point.level);
    if (!(apart < best)) continue;
    best = apart, look.has_feature = true, look.descriptor = keyframe.descriptors[i];
    look.feature_from_point = map_from_camera.q * (depth_m * Eigen::Vector3d(du / camera.fx, dv / camera.fy, 0.0));
  }
  return look;
}

}  // namespace

std::optional<DescribedLandmark> described(const Map& map, const Landmark& landmark, const DescriptionOptions& options) {
  const Node* anchor = map.nodes.find(landmark.anchor);
  if (anchor == nullptr) return std::nullopt;
  DescribedLandmark result;
  result.id = landmark.id;
  result.point_in_map = transformed(landmark.point_in_anchor(), anchor->map_from_node);

  std::vector<std::pair<const Node*, const LandmarkSighting*>> seen;
  for (const LandmarkSighting& sighting : landmark.seen) {
    const Node* node = map.nodes.find(sighting.node);
    if (node != nullptr && keyframe_of(*node) != nullptr) seen.emplace_back(node, &sighting);
  }
  std::sort(seen.begin(), seen.end(), [](const auto& a, const auto& b) {
    return a.first->stamp.ns != b.first->stamp.ns ? b.first->stamp < a.first->stamp : a.first->id < b.first->id;
  });
  if (seen.size() > static_cast<std::size_t>(options.most_views)) seen.resize(static_cast<std::size_t>(options.most_views));
  if (seen.empty()) return std::nullopt;
  result.updated_by = seen.front().first->id.session.client;

  std::vector<Look> looks;
  double sum_sigma = 0.0;
  for (const auto& [node, sighting] : seen) {
    const auto& keyframe = std::get<KeyframeFeatures>(*node->payload);
    const Pose3 map_from_camera = compose(node->map_from_node, keyframe.geometry->robot_from_camera);
    const Eigen::Vector3d ray = result.point_in_map - map_from_camera.t;
    const double range = ray.norm(), depth = transformed(result.point_in_map, inverse(map_from_camera)).z();
    if (!(depth > 0.0)) continue;
    result.direction += ray / range;
    result.nearest_m = looks.empty() ? range : std::min(result.nearest_m, range), result.farthest_m = std::max(result.farthest_m, range);
    sum_sigma += options.sigma_px * (1 << std::min<int>(sighting->level, 8)) * depth / keyframe.geometry->fx;
    looks.push_back(look_of(keyframe, *sighting, map_from_camera, depth, options.reach_px));
  }
  const auto least = [&](const Look& look) {
    int sum = 0;
    for (const Look& other : looks)
      if (other.has_feature) sum += hamming(look.descriptor, other.descriptor);
    return sum;
  };
  const Look* best = nullptr;
  for (const Look& look : looks)
    if (look.has_feature && (best == nullptr || least(look) < least(*best))) best = &look;
  if (best == nullptr) return std::nullopt;
  result.descriptor = best->descriptor, result.feature_from_point = best->feature_from_point;
  if (result.direction.norm() > 1e-6)
    result.direction.normalize();
  else
    result.direction.setZero();
  result.sigma_m = std::max(options.sigma_m, sum_sigma / static_cast<double>(looks.size()));
  return flaw(result).empty() ? std::optional(result) : std::nullopt;
}

}  // namespace mapweave::matching
