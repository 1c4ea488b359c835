#include "face_index.h"

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr double kBin_m = 0.5;  // speed alone: about the radius of a search

}  // namespace

FaceIndex::FaceIndex(const std::vector<matching::WallPoint>& faces) {
  if (faces.empty()) return;
  float x0 = faces[0].x, y0 = faces[0].y, x1 = x0, y1 = y0;
  for (const auto& face : faces) {
    x0 = std::min(x0, face.x);
    x1 = std::max(x1, face.x);
    y0 = std::min(y0, face.y);
    y1 = std::max(y1, face.y);
  }
  x0_m_ = x0;
  y0_m_ = y0;
  columns_ = static_cast<int>((x1 - x0) / kBin_m) + 1;
  rows_ = static_cast<int>((y1 - y0) / kBin_m) + 1;
  const auto bin = [&](const matching::WallPoint& face) {
    return static_cast<std::size_t>((face.y - y0_m_) / kBin_m) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>((face.x - x0_m_) / kBin_m);
  };
  first_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
  for (const auto& face : faces) ++first_[bin(face) + 1];
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  faces_.resize(faces.size());
  auto next = first_;
  for (const auto& face : faces) faces_[next[bin(face)]++] = face;
}

std::optional<FaceIndex::Match> FaceIndex::nearest(const matching::WallPoint& face, double within_m,
                                                   double least_cosine) const {
  const auto bin_of = [](double offset_m) { return static_cast<int>(std::floor(offset_m / kBin_m)); };
  const int x0 = std::max(0, bin_of(face.x - within_m - x0_m_)),
            x1 = std::min(columns_ - 1, bin_of(face.x + within_m - x0_m_));
  const int y0 = std::max(0, bin_of(face.y - within_m - y0_m_)),
            y1 = std::min(rows_ - 1, bin_of(face.y + within_m - y0_m_));
  const matching::WallPoint* best = nullptr;
  double least = within_m * within_m;
  for (int y = y0; y <= y1 && x0 <= x1; ++y) {
    const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_);
    for (std::uint32_t i = first_[row + static_cast<std::size_t>(x0)];
         i < first_[row + static_cast<std::size_t>(x1) + 1]; ++i) {
      const auto& other = faces_[i];
      const double dx = other.x - face.x, dy = other.y - face.y, square = dx * dx + dy * dy;
      if (square >= least || other.normal_x * face.normal_x + other.normal_y * face.normal_y < least_cosine) continue;
      least = square;
      best = &other;
    }
  }
  if (best == nullptr) return std::nullopt;
  return Match{*best, std::sqrt(least)};
}

}  // namespace mapweave::fusion
