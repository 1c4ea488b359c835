#include "shared_landmarks.h"

#include <mapweave/core/processor_clones.h>

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr int kMostDifferent = 50;  // bits
constexpr double kClearly = 0.85;   // nearest descriptor to the second nearest
constexpr double kCell_px = 24.0;   // speed alone: about the radius of a search

int cell_of(double pixel, int count) {
  return static_cast<int>(std::min(std::max(0.0, pixel / kCell_px), static_cast<double>(count - 1)));
}

}  // namespace

FeaturesByPlace::FeaturesByPlace(const MappedKeyframe& keyframe, double scale) : keyframe_(&keyframe) {
  columns_ = std::max(1, static_cast<int>(std::ceil(keyframe.camera.width / kCell_px)));
  rows_ = std::max(1, static_cast<int>(std::ceil(keyframe.camera.height / kCell_px)));
  std::vector<std::uint32_t> cells;
  begin_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  for (const matching::FeaturePoint& point : keyframe.points) {
    const int column = cell_of(static_cast<double>(point.u_px), columns_),
              row = cell_of(static_cast<double>(point.v_px), rows_);
    cells.push_back(static_cast<std::uint32_t>(row * columns_ + column));
    ++begin_[cells.back() + 1];
  }
  for (std::size_t cell = 1; cell < begin_.size(); ++cell) begin_[cell] += begin_[cell - 1];
  features_.resize(cells.size());
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (std::size_t f = 0; f < cells.size(); ++f)
    features_[next[cells[f]]++] = {
        static_cast<double>(keyframe.points[f].u_px), static_cast<double>(keyframe.points[f].v_px),
        scale * depth_m_of(keyframe.content->points[f].inverse_depth), static_cast<std::uint32_t>(f)};
}

MAPWEAVE_POPCOUNT_CLONES FeaturesByPlace::Nearest FeaturesByPlace::nearest_to(const SoughtLandmark& sought,
                                                                              double radius_px) const {
  const double u = sought.pixel.x(), v = sought.pixel.y();
  const int first_column = cell_of(u - radius_px, columns_), last_column = cell_of(u + radius_px, columns_);
  const int first_row = cell_of(v - radius_px, rows_), last_row = cell_of(v + radius_px, rows_);
  int second = kMostDifferent + 1;
  Nearest nearest{second, 0};
  for (int row = first_row; row <= last_row; ++row) {
    const std::uint32_t begin = begin_[static_cast<std::size_t>(row * columns_ + first_column)],
                        end = begin_[static_cast<std::size_t>(row * columns_ + last_column) + 1];
    for (std::uint32_t i = begin; i < end; ++i) {
      const Feature& feature = features_[i];
      const double du = feature.u_px - u, dv = feature.v_px - v;
      if (du * du + dv * dv > radius_px * radius_px) continue;
      if (feature.depth_m > 0.0 && std::abs(feature.depth_m - sought.depth_m) > kSameDepth * sought.depth_m) continue;
      const int bits = matching::hamming(*sought.descriptor, keyframe_->content->descriptors[feature.number]);
      if (bits < nearest.bits || (bits == nearest.bits && feature.number < nearest.feature)) {
        second = nearest.bits;
        nearest = {bits, feature.number};
      } else {
        second = std::min(second, bits);
      }
    }
  }
  return nearest.bits > kMostDifferent || nearest.bits > kClearly * second ? Nearest{kMostDifferent + 1, 0} : nearest;
}

std::vector<FeaturesByPlace::Shown> FeaturesByPlace::find(const std::vector<SoughtLandmark>& sought,
                                                          double radius_px) const {
  constexpr auto kNone = static_cast<std::size_t>(-1);
  std::vector<std::pair<int, std::size_t>> best(features_.size(), {kMostDifferent + 1, kNone});  // of each feature
  for (const SoughtLandmark& landmark : sought)
    if (const Nearest nearest = nearest_to(landmark, radius_px); nearest.bits <= kMostDifferent)
      best[nearest.feature] = std::min(best[nearest.feature], {nearest.bits, landmark.landmark});
  std::vector<Shown> shown;
  for (std::size_t f = 0; f < best.size(); ++f)
    if (best[f].second != kNone) shown.push_back({f, best[f].second});
  return shown;
}

}  // namespace mapweave::fusion
