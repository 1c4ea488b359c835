#include <mapweave/core/error.h>
#include <mapweave/core/processor_clones.h>
#include <mapweave/matching/scan_matcher.h>

#include <Eigen/Cholesky>
#include <array>
#include <cstring>

namespace mapweave::matching {
namespace {

constexpr int kLane = 16;  // poses along x tried at once

typedef std::uint8_t Bytes16 __attribute__((vector_size(kLane)));
typedef std::uint16_t Shorts16 __attribute__((vector_size(2 * kLane)));

// Adds cells `offset` past each of the rows to the sums, a lane at a time.
MAPWEAVE_WIDE_CLONES void add_rows(const std::uint8_t* const* rows, std::size_t count, std::ptrdiff_t offset, int lanes,
                                   std::uint16_t* sums) {
  for (int lane = 0; lane < lanes; ++lane, offset += kLane, sums += kLane) {
    Shorts16 all;
    std::memcpy(&all, sums, sizeof all);
    for (std::size_t k = 0; k < count; ++k) {
      Bytes16 cells;
      std::memcpy(&cells, rows[k] + offset, sizeof cells);
      all += __builtin_convertvector(cells, Shorts16);
    }
    std::memcpy(sums, &all, sizeof all);
  }
}

// Of one scan at one turn: sums of the likelihoods under its points, for all shifts of a window.
class ShiftSums {
 public:
  // Shifts of up to `radius` cells either way; along x as many more as fill the lanes.
  ShiftSums(const Raster<std::uint8_t>& grid, int radius, std::size_t point_count)
      : grid_(grid), radius_(radius), lanes_((2 * radius + 1 + kLane - 1) / kLane), side_(lanes_ * kLane) {
    MAPWEAVE_EXPECT(side_ <= static_cast<int>(edge_.size()), "search window wider than 50 m: use branch and bound");
    sums_.resize(static_cast<std::size_t>(side_) * static_cast<std::size_t>(2 * radius + 1));
    corners_.reserve(point_count);
  }
  // cells: where the points lie without a shift.
  void sum_up(const std::vector<std::pair<int, int>>& cells) {
    std::fill(sums_.begin(), sums_.end(), std::uint16_t{0});
    corners_.clear();
    for (const auto& [cx, cy] : cells) {
      const int x0 = cx - half();
      const bool whole = x0 >= grid_.first_x() && x0 + side_ <= grid_.first_x() + grid_.width();
      if (whole && cy - radius_ >= grid_.first_y() && cy + radius_ < grid_.first_y() + grid_.height())
        corners_.push_back(grid_.row(x0, cy - radius_));
      else
        add_at_rim(x0, cy, whole);
    }
    for (int dy = 0; dy <= 2 * radius_; ++dy)
      add_rows(corners_.data(), corners_.size(), static_cast<std::ptrdiff_t>(dy) * grid_.width(), lanes_,
               &sums_[static_cast<std::size_t>(dy) * static_cast<std::size_t>(side_)]);
  }
  int side() const { return side_; }
  int half() const { return side_ / 2; }
  // `side` sums: of shifts by -half, ... along x and dy along y.
  const std::uint16_t* row(int dy) const {
    return &sums_[static_cast<std::size_t>(dy + radius_) * static_cast<std::size_t>(side_)];
  }

 private:
  // A point whose window leaves the grid; `whole`: not along x.
  void add_at_rim(int x0, int cy, bool whole) {
    for (int dy = -radius_; dy <= radius_; ++dy) {
      const int y = cy + dy;
      if (y < grid_.first_y() || y >= grid_.first_y() + grid_.height()) continue;
      const std::uint8_t* row;
      if (whole) {
        row = grid_.row(x0, y);
      } else {
        const int from = std::max(x0, grid_.first_x()), to = std::min(x0 + side_, grid_.first_x() + grid_.width());
        if (from >= to) continue;
        std::memset(edge_.data(), 0, static_cast<std::size_t>(side_));
        std::memcpy(edge_.data() + (from - x0), grid_.row(from, y), static_cast<std::size_t>(to - from));
        row = edge_.data();
      }
      add_rows(&row, 1, 0, lanes_, &sums_[static_cast<std::size_t>(dy + radius_) * static_cast<std::size_t>(side_)]);
    }
  }

  const Raster<std::uint8_t>& grid_;
  int radius_, lanes_, side_;  // cells; side: along x
  std::vector<std::uint16_t> sums_;
  std::vector<const std::uint8_t*> corners_;  // of the points' windows that lie within the grid
  std::array<std::uint8_t, 1024> edge_{};     // a row that leaves the grid
};

void place(const std::vector<WallPoint>& points, const Pose2& field_from_scan,
           std::vector<std::pair<int, int>>& cells) {
  constexpr double kInverse = 1.0 / WallField::kResolution;
  const double c = std::cos(field_from_scan.phi), s = std::sin(field_from_scan.phi);
  for (std::size_t k = 0; k < points.size(); ++k) {
    const double x = c * points[k].x - s * points[k].y + field_from_scan.x,
                 y = s * points[k].x + c * points[k].y + field_from_scan.y;
    cells[k] = {cell_of(x, kInverse), cell_of(y, kInverse)};
  }
}

}  // namespace

std::optional<Correlation> correlate(const Raster<std::uint8_t>& grid, const std::vector<WallPoint>& points,
                                     const Pose2& guess, const SearchWindow& window, const PriorWeight& weight) {
  if (grid.empty() || points.empty()) return std::nullopt;
  MAPWEAVE_EXPECT(points.size() <= 256, "a 16-bit sum holds 256 points of 8 bits");
  const int radius = std::max(1, static_cast<int>(std::ceil(window.radius_m * (1.0 / WallField::kResolution))));
  const int turns = std::max(1, static_cast<int>(std::ceil(window.yaw_rad / window.yaw_step_rad)));
  ShiftSums sums(grid, radius, points.size());
  std::vector<std::pair<int, int>> cells(points.size());

  // The prior costs score: one sigma costs 0.02 of the mean likelihood, so it decides ties and near-ties only.
  const double full = 255.0 * static_cast<double>(points.size());
  const double cost_m =
      0.02 * full * WallField::kResolution * WallField::kResolution / (weight.sigma_m * weight.sigma_m);
  const double cost_yaw =
      0.02 * full * window.yaw_step_rad * window.yaw_step_rad / (weight.sigma_yaw_rad * weight.sigma_yaw_rad);

  double best_value = -1e300;
  int best_turn = 0, best_x = 0, best_y = 0;
  std::uint16_t best_sum = 0;
  const int side = sums.side(), half = sums.half();
  for (int turn = -turns; turn <= turns; ++turn) {
    place(points, {guess.x, guess.y, guess.phi + turn * window.yaw_step_rad}, cells);
    sums.sum_up(cells);
    for (int dy = -radius; dy <= radius; ++dy) {
      const std::uint16_t* sum = sums.row(dy);
      for (int i = 0; i < side; ++i) {
        const int dx = i - half;
        const double value = sum[i] - cost_m * (dx * dx + dy * dy) - cost_yaw * turn * turn;
        if (value > best_value) {
          best_value = value;
          best_turn = turn;
          best_x = dx;
          best_y = dy;
          best_sum = sum[i];
        }
      }
    }
  }
  Correlation result;
  result.field_from_scan = {guess.x + best_x * WallField::kResolution, guess.y + best_y * WallField::kResolution,
                            wrap_angle(guess.phi + best_turn * window.yaw_step_rad)};
  result.score = best_sum / full;
  result.at_border = std::abs(best_turn) == turns || std::abs(best_x) >= radius || std::abs(best_y) == radius;
  return result;
}

namespace {

template <class Field>
ScanMatch refined(const Field& field, const std::vector<WallPoint>& points, const Pose2& start, const Pose2& prior_pose,
                  const PriorWeight* prior, int iterations) {
  ScanMatch match;
  match.field_from_scan = start;
  if (points.empty()) return match;
  double x = start.x, y = start.y, phi = start.phi;
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  int used = 0;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    hessian.setZero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    const double c = std::cos(phi), s = std::sin(phi);
    used = 0;
    for (const auto& p : points) {
      const double rx = c * p.x - s * p.y, ry = s * p.x + c * p.y;
      const LocalNormal* normal =
          field.normal_at(rx + x, ry + y, c * p.normal_x - s * p.normal_y, s * p.normal_x + c * p.normal_y);
      if (normal == nullptr) continue;
      const double dx = rx + x - normal->mean_x, dy = ry + y - normal->mean_y;
      const double r0 = normal->w00 * dx + normal->w10 * dy, r1 = normal->w11 * dy;
      const double square = r0 * r0 + r1 * r1;
      if (square < 9.0) ++used;
      const double weight = 1.0 / ((1.0 + square / 9.0) * (1.0 + square / 9.0));  // Geman-McClure, 3 sigma
      // d(point)/d(x, y, phi) in the field's frame
      const double j00 = normal->w00, j01 = normal->w10, j02 = normal->w00 * -ry + normal->w10 * rx;
      const double j11 = normal->w11, j12 = normal->w11 * rx;
      hessian(0, 0) += weight * j00 * j00;
      hessian(0, 1) += weight * j00 * j01;
      hessian(0, 2) += weight * j00 * j02;
      hessian(1, 1) += weight * (j01 * j01 + j11 * j11);
      hessian(1, 2) += weight * (j01 * j02 + j11 * j12);
      hessian(2, 2) += weight * (j02 * j02 + j12 * j12);
      gradient(0) += weight * j00 * r0;
      gradient(1) += weight * (j01 * r0 + j11 * r1);
      gradient(2) += weight * (j02 * r0 + j12 * r1);
    }
    hessian(1, 0) = hessian(0, 1);
    hessian(2, 0) = hessian(0, 2);
    hessian(2, 1) = hessian(1, 2);
    Eigen::Matrix3d system = hessian;
    system.diagonal() += Eigen::Vector3d(1.0, 1.0, 0.1);
    if (prior != nullptr) {
      // Wheels slip and turns are missed: a prior that is far off holds nothing.
      const double im0 = 1.0 / (prior->sigma_m * prior->sigma_m),
                   iy0 = 1.0 / (prior->sigma_yaw_rad * prior->sigma_yaw_rad);
      const double off_x = x - prior_pose.x, off_y = y - prior_pose.y, off_yaw = wrap_angle(phi - prior_pose.phi);
      const double far = 1.0 + (off_x * off_x + off_y * off_y) * im0 / prior->gate,
                   turned = 1.0 + off_yaw * off_yaw * iy0 / prior->gate;
      const double im = im0 / (far * far), iy = iy0 / (turned * turned);
      system(0, 0) += im;
      system(1, 1) += im;
      system(2, 2) += iy;
      gradient += Eigen::Vector3d(im * off_x, im * off_y, iy * off_yaw);
    }
    const Eigen::Vector3d step = system.ldlt().solve(-gradient);
    if (!step.allFinite()) break;
    x += step(0);
    y += step(1);
    phi += step(2);
    if (std::abs(step(0)) + std::abs(step(1)) < 2e-4 && std::abs(step(2)) < 2e-5) break;
  }
  match.field_from_scan = {x, y, wrap_angle(phi)};
  match.inliers = static_cast<double>(used) / static_cast<double>(points.size());
  const auto& grid = field.likelihood();
  double sum = 0;
  const double c = std::cos(phi), s = std::sin(phi);
  for (const auto& p : points)
    sum += grid.get(cell_of(c * p.x - s * p.y + x, 1.0 / WallField::kResolution),
                    cell_of(s * p.x + c * p.y + y, 1.0 / WallField::kResolution));
  match.score = sum / (255.0 * static_cast<double>(points.size()));
  // From the field's frame into the scan's: a small motion there is a rotated one here.
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  rotation(0, 0) = c;
  rotation(0, 1) = -s;
  rotation(1, 0) = s;
  rotation(1, 1) = c;
  match.information = rotation.transpose() * hessian * rotation;
  return match;
}

}  // namespace

ScanMatch refine(const WallField& field, const std::vector<WallPoint>& points, const Pose2& start,
                 const Pose2& prior_pose, const PriorWeight* prior, int iterations) {
  return refined(field, points, start, prior_pose, prior, iterations);
}

ScanMatch refine(const SparseWallField& field, const std::vector<WallPoint>& points, const Pose2& start,
                 const Pose2& prior_pose, const PriorWeight* prior, int iterations) {
  return refined(field, points, start, prior_pose, prior, iterations);
}

}  // namespace mapweave::matching
