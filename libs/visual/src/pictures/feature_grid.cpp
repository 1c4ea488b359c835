#include "feature_grid.h"

#include <algorithm>
#include <cmath>

namespace mapweave::visual {
namespace {

constexpr int kCell_px = 16;  // speed alone: about the radius of a search

}  // namespace

FrameFeatureGrid::FrameFeatureGrid(const FeatureFrame& frame, const Pinhole& camera)
    : level_factor_(frame.level_factor), columns_(camera.width / kCell_px + 1), rows_(camera.height / kCell_px + 1) {
  std::vector<int> cells;
  for (std::size_t i = 0; i < frame.features.points.size(); ++i) {
    const matching::FeaturePoint& point = frame.features.points[i];
    const auto width = static_cast<float>(camera.width), height = static_cast<float>(camera.height);
    if (!(point.u_px >= 0 && point.v_px >= 0 && point.u_px < width && point.v_px < height)) continue;
    const float inverse_depth = frame.inverse_depths[i];
    features_.points.push_back(point);
    features_.descriptors.push_back(frame.features.descriptors[i]);
    inverse_depths_.push_back(std::isfinite(inverse_depth) && inverse_depth > 0 ? inverse_depth : 0.0F);
    cells.push_back(static_cast<int>(point.v_px) / kCell_px * columns_ + static_cast<int>(point.u_px) / kCell_px);
  }
  first_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  for (int cell : cells) ++first_[static_cast<std::size_t>(cell) + 1];
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  std::vector<int> next(first_.begin(), first_.end() - 1);
  members_.resize(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i)
    members_[static_cast<std::size_t>(next[static_cast<std::size_t>(cells[i])]++)] = static_cast<int>(i);
}

Eigen::Vector2d FrameFeatureGrid::pixel(int feature) const {
  const matching::FeaturePoint& point = features_.points[static_cast<std::size_t>(feature)];
  return {static_cast<double>(point.u_px), static_cast<double>(point.v_px)};
}

int FrameFeatureGrid::level(int feature) const {
  const double octaves = features_.points[static_cast<std::size_t>(feature)].level * std::log2(level_factor_);
  return std::clamp(static_cast<int>(std::lround(octaves)), 0, 4);
}

int FrameFeatureGrid::find(const matching::OrbDescriptor& descriptor, const Eigen::Vector2d& at, double radius,
                           const std::vector<char>& taken) const {
  const auto cell = [](double coordinate, int count) {
    return static_cast<int>(std::clamp(coordinate / kCell_px, 0.0, count - 1.0));
  };
  const int left = cell(at.x() - radius, columns_), right = cell(at.x() + radius, columns_),
            top = cell(at.y() - radius, rows_), bottom = cell(at.y() + radius, rows_);
  int best = -1, distance = kMostBits + 1, second = 257;
  for (int y = top; y <= bottom; ++y)
    for (int i = first_[static_cast<std::size_t>(y * columns_ + left)];
         i < first_[static_cast<std::size_t>(y * columns_ + right) + 1]; ++i) {
      const int feature = members_[static_cast<std::size_t>(i)];
      if (taken[static_cast<std::size_t>(feature)] || !((pixel(feature) - at).squaredNorm() < radius * radius))
        continue;
      const int bits = matching::hamming(descriptor, features_.descriptors[static_cast<std::size_t>(feature)]);
      if (bits < distance) {
        second = std::min(second, distance);
        distance = bits;
        best = feature;
      } else {
        second = std::min(second, bits);
      }
    }
  return best >= 0 && distance <= kClearlyNearest * second ? best : -1;
}

FrameFeatureGrid grid_of(const matching::OrbFeatures& features, const Pinhole& camera) {
  FeatureFrame frame;
  frame.features = features;
  frame.inverse_depths.assign(features.points.size(), 0.0F);
  return FrameFeatureGrid(frame, camera);
}

}  // namespace mapweave::visual
