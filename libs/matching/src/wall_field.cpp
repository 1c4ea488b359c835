#include <mapweave/matching/wall_field.h>

#include <array>

namespace mapweave::matching {
namespace {

constexpr int kKernelRadius = 4;         // likelihood cells
constexpr double kKernelSigma_m = 0.07;  // how far a wall may seem to be off: sensor, pose and cell
constexpr double kInverseResolution = 1.0 / WallField::kResolution;
constexpr double kInverseCellSide = 1.0 / WallField::kCellSide;
constexpr float kNoise_m = 0.02F;  // of a wall point across its wall: the floor of a distribution's width
constexpr float kMinCount = 3.0F;  // points that make a distribution

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

constexpr std::size_t kQuadrants[4][2] = {{0, 2}, {0, 1}, {1, 3}, {2, 3}};  // of the sides +u, +v, -u, -v

struct Direction {
  float u, v;
};

// Axes turned by 22.5 degrees: most walls run along x or y, and none of those should lie on the border of two
// quadrants.
Direction turned(float x, float y) {
  constexpr float c = 0.92387953F, s = 0.38268343F;
  return {c * x + s * y, c * y - s * x};
}

std::size_t quadrant_of(const Direction& d) { return (d.u < 0 ? 1U : 0U) + (d.v < 0 ? 2U : 0U); }

std::size_t side_facing(double normal_x, double normal_y) {
  const Direction facing = turned(static_cast<float>(normal_x), static_cast<float>(normal_y));
  return std::abs(facing.u) >= std::abs(facing.v) ? (facing.u >= 0 ? 0 : 2) : (facing.v >= 0 ? 1 : 3);
}

// Of n points with these sums; the mean relative to where the sums are.
LocalNormal local_normal(float n, float x, float y, float xx, float xy, float yy) {
  const float mx = x / n, my = y / n;
  const float cxx = xx / n - mx * mx, cxy = xy / n - mx * my, cyy = yy / n - my * my;
  // Eigenvalues of the 2 x 2 covariance, widened by the sensor's noise.
  const float half_trace = 0.5F * (cxx + cyy),
              root = std::sqrt(std::max(0.0F, 0.25F * (cxx - cyy) * (cxx - cyy) + cxy * cxy));
  const float large = std::max(half_trace + root, 0.0F), small = std::max(half_trace - root, 0.0F);
  float ax = cxy, ay = large - cxx;  // along the wall
  if (std::abs(ax) + std::abs(ay) < 1e-9F) {
    ax = cxx >= cyy ? 1.0F : 0.0F;
    ay = 1.0F - ax;
  }
  const float length = std::sqrt(ax * ax + ay * ay);
  ax /= length;
  ay /= length;
  LocalNormal normal;
  normal.mean_x = mx;
  normal.mean_y = my;
  normal.normal_x = -ay;
  normal.normal_y = ax;
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
  return normal;
}

}  // namespace

void WallField::reserve(double low_x, double low_y, double high_x, double high_y) {
  likelihood_.grow(
      cell_of(low_x, kInverseResolution) - 2 * kKernelRadius, cell_of(low_y, kInverseResolution) - 2 * kKernelRadius,
      cell_of(high_x, kInverseResolution) + 2 * kKernelRadius, cell_of(high_y, kInverseResolution) + 2 * kKernelRadius);
  const int cx0 = cell_of(low_x, kInverseCellSide) - 2, cy0 = cell_of(low_y, kInverseCellSide) - 2;
  const int cx1 = cell_of(high_x, kInverseCellSide) + 2, cy1 = cell_of(high_y, kInverseCellSide) + 2;
  if (cell_index_.empty()) {
    cell_index_ = Raster<std::int32_t>(cx0, cy0, cx1, cy1, -1);
    sides_index_ = Raster<std::int32_t>(cx0, cy0, cx1, cy1, -1);
  } else {
    cell_index_.grow(cx0, cy0, cx1, cy1);
    sides_index_.grow(cx0, cy0, cx1, cy1);
  }
}

void WallField::add(const std::vector<WallPoint>& points_in_field) {
  if (points_in_field.empty()) return;
  static const Kernel kernel = make_kernel();
  float low_x = points_in_field[0].x, high_x = low_x, low_y = points_in_field[0].y, high_y = low_y;
  for (const auto& p : points_in_field) {
    low_x = std::min(low_x, p.x);
    high_x = std::max(high_x, p.x);
    low_y = std::min(low_y, p.y);
    high_y = std::max(high_y, p.y);
  }
  reserve(low_x, low_y, high_x, high_y);
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
    std::int32_t& index = cell_index_.at(cx, cy);
    if (index < 0) {
      index = static_cast<std::int32_t>(cells_.size());
      cells_.emplace_back();
    }
    Cell& cell = cells_[static_cast<std::size_t>(index)];
    if (!cell.touched) {
      cell.touched = true;
      touched_.emplace_back(cx, cy);
    }
    const float dx = p.x - static_cast<float>((cx + 0.5) * kCellSide),
                dy = p.y - static_cast<float>((cy + 0.5) * kCellSide);
    cell.quadrants[quadrant_of(turned(p.normal_x, p.normal_y))].add({1, dx, dy, dx * dx, dx * dy, dy * dy}, 0, 0);
  }
}

void WallField::Sums::add(const Sums& s, float offset_x, float offset_y) {
  n += s.n;
  x += s.x + s.n * offset_x;
  y += s.y + s.n * offset_y;
  xx += s.xx + 2 * offset_x * s.x + s.n * offset_x * offset_x;
  xy += s.xy + offset_x * s.y + offset_y * s.x + s.n * offset_x * offset_y;
  yy += s.yy + 2 * offset_y * s.y + s.n * offset_y * offset_y;
}

// Each distribution near a touched cell changes, once.
void WallField::settle() {
  ++settlings_;
  for (const auto& [cx, cy] : touched_) {
    cells_[static_cast<std::size_t>(cell_index_.at(cx, cy))].touched = false;
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        std::int32_t& index = sides_index_.at(cx + i, cy + j);
        if (index < 0) {
          index = static_cast<std::int32_t>(sides_.size());
          sides_.emplace_back();
        }
        Sides& sides = sides_[static_cast<std::size_t>(index)];
        if (sides.settled == settlings_) continue;
        sides.settled = settlings_;
        update(cx + i, cy + j, sides);
      }
  }
  touched_.clear();
}

void WallField::update(int cell_x, int cell_y, Sides& sides) {
  std::array<Sums, 4> quadrants;
  for (int j = -1; j <= 1; ++j)
    for (int i = -1; i <= 1; ++i) {
      const std::int32_t index = cell_index_.get(cell_x + i, cell_y + j);
      if (index < 0) continue;
      const Cell& cell = cells_[static_cast<std::size_t>(index)];
      for (std::size_t q = 0; q < quadrants.size(); ++q)
        if (cell.quadrants[q].n > 0)
          quadrants[q].add(cell.quadrants[q], static_cast<float>(i * kCellSide), static_cast<float>(j * kCellSide));
    }
  for (std::size_t side = 0; side < sides.normals.size(); ++side) {
    Sums all = quadrants[kQuadrants[side][0]];
    all.add(quadrants[kQuadrants[side][1]], 0, 0);
    if (all.n < kMinCount) continue;
    std::int32_t& index = sides.normals[side];
    if (index < 0) {
      index = static_cast<std::int32_t>(normals_.size());
      normals_.emplace_back();
    }
    LocalNormal& normal = normals_[static_cast<std::size_t>(index)];
    normal = local_normal(all.n, all.x, all.y, all.xx, all.xy, all.yy);
    normal.mean_x += static_cast<float>((cell_x + 0.5) * kCellSide);
    normal.mean_y += static_cast<float>((cell_y + 0.5) * kCellSide);
    // Towards the middle of the two quadrants, and of the one that holds more.
    const float a = quadrants[kQuadrants[side][0]].n, b = quadrants[kQuadrants[side][1]].n, lean = (a - b) / (a + b);
    const Direction facing{side == 0 ? 1.0F : side == 2 ? -1.0F : lean, side == 1 ? 1.0F : side == 3 ? -1.0F : lean};
    const Direction here = turned(normal.normal_x, normal.normal_y);
    if (facing.u * here.u + facing.v * here.v < 0) {
      normal.normal_x = -normal.normal_x;
      normal.normal_y = -normal.normal_y;
    }
  }
}

const LocalNormal* WallField::normal_at(double x, double y, double normal_x, double normal_y) const {
  const std::int32_t index = sides_index_.get(cell_of(x, kInverseCellSide), cell_of(y, kInverseCellSide));
  if (sides_index_.empty() || index < 0) return nullptr;
  const std::int32_t normal = sides_[static_cast<std::size_t>(index)].normals[side_facing(normal_x, normal_y)];
  return normal < 0 ? nullptr : &normals_[static_cast<std::size_t>(normal)];
}

std::vector<WallPoint> WallField::walls(float min_count) const {
  std::vector<WallPoint> walls;
  for (int y = cell_index_.first_y(); y < cell_index_.first_y() + cell_index_.height(); ++y)
    for (int x = cell_index_.first_x(); x < cell_index_.first_x() + cell_index_.width(); ++x) {
      const std::int32_t index = cell_index_.at(x, y), around = sides_index_.at(x, y);
      if (index < 0 || around < 0) continue;
      const Cell& cell = cells_[static_cast<std::size_t>(index)];
      std::array<Sums, 4> sums;
      std::size_t most = 0;
      for (std::size_t side = 0; side < sums.size(); ++side) {
        for (const std::size_t q : kQuadrants[side]) sums[side].add(cell.quadrants[q], 0, 0);
        if (sums[side].n > sums[most].n) most = side;
      }
      // The side that most points are of, and its back.
      for (const std::size_t side : {most, (most + 2) % 4}) {
        const Sums& s = sums[side];
        const std::int32_t normal = sides_[static_cast<std::size_t>(around)].normals[side];
        if (s.n < min_count || normal < 0) continue;
        const LocalNormal& here = normals_[static_cast<std::size_t>(normal)];
        walls.push_back({static_cast<float>((x + 0.5) * kCellSide) + s.x / s.n,
                         static_cast<float>((y + 0.5) * kCellSide) + s.y / s.n, here.normal_x, here.normal_y});
      }
    }
  return walls;
}

SparseWallField::SparseWallField(const WallField& settled) : likelihood_(settled.likelihood_) {
  Raster<std::int32_t> sides = settled.sides_index_;
  for (int y = sides.first_y(); y < sides.first_y() + sides.height(); ++y)
    for (int x = sides.first_x(); x < sides.first_x() + sides.width(); ++x) {
      std::int32_t& cell = sides.at(x, y);
      if (cell < 0) continue;
      const auto& normals = settled.sides_[static_cast<std::size_t>(cell)].normals;
      const auto first = static_cast<std::int32_t>(normals_.size());
      std::int32_t present = 0;
      for (std::size_t side = 0; side < normals.size(); ++side) {
        if (normals[side] < 0) continue;
        present |= std::int32_t{1} << side;
        normals_.push_back(settled.normals_[static_cast<std::size_t>(normals[side])]);
      }
      cell = present == 0 ? -1 : first * 16 + present;
    }
  sides_ = SparseRaster<std::int32_t>(sides);
  normals_.shrink_to_fit();
}

const LocalNormal* SparseWallField::normal_at(double x, double y, double normal_x, double normal_y) const {
  const std::int32_t sides = sides_.get(cell_of(x, kInverseCellSide), cell_of(y, kInverseCellSide));
  if (sides_.empty() || sides < 0) return nullptr;
  const auto side = std::int32_t{1} << side_facing(normal_x, normal_y);
  if ((sides & side) == 0) return nullptr;
  const auto before = static_cast<std::size_t>(__builtin_popcount(static_cast<unsigned>(sides & (side - 1))));
  return &normals_[static_cast<std::size_t>(sides / 16) + before];
}

std::size_t SparseWallField::bytes() const {
  return likelihood_.bytes() + sides_.bytes() + normals_.capacity() * sizeof(LocalNormal);
}

}  // namespace mapweave::matching
