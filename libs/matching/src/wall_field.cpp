#include <mapweave/matching/wall_field.h>

#include <array>

namespace mapweave::matching {
namespace {

constexpr int kKernelRadius = 4;  // likelihood cells
constexpr double kKernelSigma_m = 0.07;
constexpr double kInverseResolution = 1.0 / WallField::kResolution;
constexpr double kInverseCellSide = 1.0 / WallField::kCellSide;
constexpr float kNoise_m = 0.02F;   // of a wall point across its wall: the floor of a distribution's width
constexpr float kMinCount = 3.0F;   // points that make a distribution

using Kernel = std::array<std::array<std::uint8_t, 2 * kKernelRadius + 1>, 2 * kKernelRadius + 1>;

Kernel make_kernel() {
  Kernel kernel{};
  for (int j = -kKernelRadius; j <= kKernelRadius; ++j)
    for (int i = -kKernelRadius; i <= kKernelRadius; ++i) {
      const double square = (i * i + j * j) * WallField::kResolution * WallField::kResolution;
      kernel[static_cast<std::size_t>(j + kKernelRadius)][static_cast<std::size_t>(i + kKernelRadius)] =
          static_cast<std::uint8_t>(std::lround(255.0 * std::exp(-0.5 * square / (kKernelSigma_m * kKernelSigma_m))));
    }
  return kernel;
}

}  // namespace

void WallField::add(const std::vector<Point2f>& points_in_field) {
  if (points_in_field.empty()) return;
  static const Kernel kernel = make_kernel();
  float low_x = points_in_field[0].x, high_x = low_x, low_y = points_in_field[0].y, high_y = low_y;
  for (const auto& p : points_in_field) {
    low_x = std::min(low_x, p.x), high_x = std::max(high_x, p.x);
    low_y = std::min(low_y, p.y), high_y = std::max(high_y, p.y);
  }
  likelihood_.grow(cell_of(low_x, kInverseResolution) - 2 * kKernelRadius, cell_of(low_y, kInverseResolution) - 2 * kKernelRadius,
                   cell_of(high_x, kInverseResolution) + 2 * kKernelRadius, cell_of(high_y, kInverseResolution) + 2 * kKernelRadius);
  const int cx0 = cell_of(low_x, kInverseCellSide) - 2, cy0 = cell_of(low_y, kInverseCellSide) - 2;
  const int cx1 = cell_of(high_x, kInverseCellSide) + 2, cy1 = cell_of(high_y, kInverseCellSide) + 2;
  if (sums_index_.empty()) {
    sums_index_ = Raster<std::int32_t>(cx0, cy0, cx1, cy1, -1);
    normal_index_ = Raster<std::int32_t>(cx0, cy0, cx1, cy1, -1);
  } else {
    sums_index_.grow(cx0, cy0, cx1, cy1);
    normal_index_.grow(cx0, cy0, cx1, cy1);
  }

  for (const auto& p : points_in_field) {
    const int px = cell_of(p.x, kInverseResolution), py = cell_of(p.y, kInverseResolution);
    if (likelihood_.at(px, py) < 255) {
      for (int j = -kKernelRadius; j <= kKernelRadius; ++j) {
        std::uint8_t* row = likelihood_.row(px - kKernelRadius, py + j);
        const auto& from = kernel[static_cast<std::size_t>(j + kKernelRadius)];
        for (std::size_t i = 0; i < from.size(); ++i) row[i] = std::max(row[i], from[i]);
      }
    }
    const int cx = cell_of(p.x, kInverseCellSide), cy = cell_of(p.y, kInverseCellSide);
    std::int32_t& index = sums_index_.at(cx, cy);
    if (index < 0) {
      index = static_cast<std::int32_t>(sums_.size());
      sums_.emplace_back();
    }
    Sums& sums = sums_[static_cast<std::size_t>(index)];
    const float dx = p.x - static_cast<float>((cx + 0.5) * kCellSide), dy = p.y - static_cast<float>((cy + 0.5) * kCellSide);
    sums.n += 1, sums.x += dx, sums.y += dy, sums.xx += dx * dx, sums.xy += dx * dy, sums.yy += dy * dy;
  }
  // Each distribution near a point changes, once.
  ++additions_;
  for (const auto& p : points_in_field) {
    const int cx = cell_of(p.x, kInverseCellSide), cy = cell_of(p.y, kInverseCellSide);
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        std::int32_t& index = normal_index_.at(cx + i, cy + j);
        if (index < 0) {
          index = static_cast<std::int32_t>(normals_.size());
          normals_.emplace_back();
        }
        Distribution& distribution = normals_[static_cast<std::size_t>(index)];
        if (distribution.addition == additions_) continue;
        distribution.addition = additions_;
        update(cx + i, cy + j, distribution);
      }
  }
}

void WallField::update(int cell_x, int cell_y, Distribution& distribution) const {
  Sums all;
  for (int j = -1; j <= 1; ++j)
    for (int i = -1; i <= 1; ++i) {
      const std::int32_t index = sums_index_.get(cell_x + i, cell_y + j);
      if (index < 0) continue;
      const Sums& s = sums_[static_cast<std::size_t>(index)];
      const float ox = static_cast<float>(i * kCellSide), oy = static_cast<float>(j * kCellSide);
      all.n += s.n;
      all.x += s.x + s.n * ox;
      all.y += s.y + s.n * oy;
      all.xx += s.xx + 2 * ox * s.x + s.n * ox * ox;
      all.xy += s.xy + ox * s.y + oy * s.x + s.n * ox * oy;
      all.yy += s.yy + 2 * oy * s.y + s.n * oy * oy;
    }
  if (all.n < kMinCount) return;
  const float mx = all.x / all.n, my = all.y / all.n;
  const float cxx = all.xx / all.n - mx * mx, cxy = all.xy / all.n - mx * my, cyy = all.yy / all.n - my * my;
  // Eigenvalues of the 2 x 2 covariance, widened by the sensor's noise.
  const float half_trace = 0.5F * (cxx + cyy), root = std::sqrt(std::max(0.0F, 0.25F * (cxx - cyy) * (cxx - cyy) + cxy * cxy));
  const float large = std::max(half_trace + root, 0.0F), small = std::max(half_trace - root, 0.0F);
  float ax = cxy, ay = large - cxx;  // along the wall
  if (std::abs(ax) + std::abs(ay) < 1e-9F) {
    ax = cxx >= cyy ? 1.0F : 0.0F, ay = 1.0F - ax;
  }
  const float length = std::sqrt(ax * ax + ay * ay);
  ax /= length, ay /= length;
  LocalNormal& normal = distribution.normal;
  distribution.valid = true;
  normal.mean_x = mx + static_cast<float>((cell_x + 0.5) * kCellSide);
  normal.mean_y = my + static_cast<float>((cell_y + 0.5) * kCellSide);
  normal.normal_x = -ay, normal.normal_y = ax;
  normal.flatness = large > 0 ? (large - small) / (large + small + kNoise_m * kNoise_m) : 0.0F;
  // A flat distribution says nothing along the wall: where a point lies along it depends on where the rays fell.
  const float across = 1.0F / std::sqrt(small + kNoise_m * kNoise_m);
  const float along = normal.flatness > 0.8F ? 0.0F : 0.5F / std::sqrt(large + kNoise_m * kNoise_m);
  const float ix = across * across, ia = along * along;
  const float i00 = ix * ay * ay + ia * ax * ax, i01 = -ix * ax * ay + ia * ax * ay, i11 = ix * ax * ax + ia * ay * ay;
  // information = L L^T with L lower triangular; residual = L^T d. Rank 1 when `along` is zero.
  normal.w00 = std::sqrt(std::max(i00, 0.0F));
  normal.w10 = normal.w00 > 1e-6F ? i01 / normal.w00 : 0.0F;
  normal.w11 = std::sqrt(std::max(i11 - normal.w10 * normal.w10, 0.0F));
}

const LocalNormal* WallField::normal_at(double x, double y) const {
  const std::int32_t index = normal_index_.get(cell_of(x, kInverseCellSide), cell_of(y, kInverseCellSide));
  if (normal_index_.empty() || index < 0) return nullptr;
  const Distribution& distribution = normals_[static_cast<std::size_t>(index)];
  return distribution.valid ? &distribution.normal : nullptr;
}

std::vector<WallField::WallCell> WallField::wall_cells(float min_count) const {
  std::vector<WallCell> cells;
  for (int y = sums_index_.first_y(); y < sums_index_.first_y() + sums_index_.height(); ++y)
    for (int x = sums_index_.first_x(); x < sums_index_.first_x() + sums_index_.width(); ++x) {
      const std::int32_t index = sums_index_.at(x, y);
      const std::int32_t normal = normal_index_.at(x, y);
      if (index < 0 || normal < 0 || !normals_[static_cast<std::size_t>(normal)].valid) continue;
      const Sums& s = sums_[static_cast<std::size_t>(index)];
      if (s.n < min_count) continue;
      cells.push_back({{static_cast<float>((x + 0.5) * kCellSide) + s.x / s.n, static_cast<float>((y + 0.5) * kCellSide) + s.y / s.n},
                       normals_[static_cast<std::size_t>(normal)].normal, s.n});
    }
  return cells;
}

std::size_t WallField::bytes() const {
  return likelihood_.bytes() + sums_index_.bytes() + normal_index_.bytes() + sums_.capacity() * sizeof(Sums) + normals_.capacity() * sizeof(Distribution);
}

}  // namespace mapweave::matching
