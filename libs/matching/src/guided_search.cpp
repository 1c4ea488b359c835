#include "guided_search.h"

#include <algorithm>
#include <cmath>

namespace mapweave::matching {

KeyframeFeatureGrid::KeyframeFeatureGrid(const KeyframeView& keyframe)
    : keyframe_(keyframe),
      columns_(std::max(1, static_cast<int>(std::ceil(keyframe.camera.width / kCell)))),
      rows_(std::max(1, static_cast<int>(std::ceil(keyframe.camera.height / kCell)))) {
  begin_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  order_.resize(keyframe.features.count);
  const auto place_of = [&](std::size_t i) {
    const FeaturePoint& point = keyframe.features.points[i];
    return static_cast<std::size_t>(cell(point.v_px, rows_) * columns_ + cell(point.u_px, columns_));
  };
  for (std::size_t i = 0; i < order_.size(); ++i) ++begin_[place_of(i) + 1];
  for (std::size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (std::size_t i = 0; i < order_.size(); ++i) order_[next[place_of(i)]++] = static_cast<std::uint32_t>(i);
}

GuidedSearch search_landmarks(const std::vector<LandmarkView>& landmarks, const Sim3& camera_from_side,
                              const KeyframeFeatureGrid& grid, const std::vector<double>& depth_of_feature,
                              double radius_px, int max_distance) {
  const KeyframeView& keyframe = grid.keyframe();
  GuidedSearch search;
  // In front of the camera; Lowe's test; a share of the depth; pixels that show what stands there.
  constexpr double kNearest = 1e-3, kRatio = 0.9, kInFront = 0.75, kAround = 16.0;
  std::vector<std::uint32_t> near;
  for (std::uint32_t i = 0; i < landmarks.size(); ++i) {
    const Eigen::Vector3d point = transformed(landmarks[i].point_in_side, camera_from_side);
    if (!(point.z() > kNearest)) continue;
    const Eigen::Vector2d pixel = keyframe.camera.project(point);
    if (!keyframe.camera.shows(pixel)) continue;
    ++search.expected;
    near.clear();
    grid.near(pixel, radius_px, [&](std::uint32_t feature) { near.push_back(feature); });
    const NearestDescriptors nearest =
        nearest_descriptors(landmarks[i].descriptor, keyframe.features.descriptors, near.data(), near.size());
    if (nearest.distance <= max_distance && nearest.distance <= kRatio * nearest.second_distance) {
      search.found.push_back({i, near[nearest.first], nearest.distance});
      continue;
    }
    // Seen through where everything that is known around lies clearly farther away, and at least two things are known.
    if (depth_of_feature.empty()) continue;
    int known = 0, farther = 0;
    grid.near(pixel, kAround, [&](std::uint32_t feature) {
      const double depth = depth_of_feature[feature];
      if (!(depth > 0.0)) return;
      ++known;
      farther += point.z() < kInFront * depth;
    });
    search.seen_through += known >= 2 && farther == known;
  }
  // Of landmarks that claim one feature, the one that looks most like it; of equals the first.
  std::vector<std::pair<int, std::uint32_t>> best(keyframe.features.count, {257, 0});
  for (std::uint32_t i = 0; i < search.found.size(); ++i)
    best[search.found[i].feature] = std::min(best[search.found[i].feature], {search.found[i].distance, i});
  std::vector<GuidedSearch::Found> unique;
  for (std::uint32_t i = 0; i < search.found.size(); ++i)
    if (best[search.found[i].feature].second == i) unique.push_back(search.found[i]);
  search.found = std::move(unique);
  return search;
}

}  // namespace mapweave::matching
