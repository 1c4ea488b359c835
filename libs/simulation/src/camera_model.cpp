#include <mapweave/simulation/camera_model.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

Eigen::Vector2d distorted(const Eigen::Vector2d& p, const std::array<double, 5>& d) {
  const double r2 = p.squaredNorm(), radial = 1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
  return {p.x() * radial + 2.0 * d[2] * p.x() * p.y() + d[3] * (r2 + 2.0 * p.x() * p.x()),
          p.y() * radial + d[2] * (r2 + 2.0 * p.y() * p.y()) + 2.0 * d[3] * p.x() * p.y()};
}

}  // namespace

bool CameraIntrinsics::is_distorted() const {
  return std::any_of(distortion.begin(), distortion.end(), [](double coefficient) { return coefficient != 0.0; });
}

CameraModel::CameraModel(const CameraIntrinsics& intrinsics) : intrinsics_(intrinsics) {
  MAPWEAVE_EXPECT(intrinsics.width > 0 && intrinsics.height > 0 && intrinsics.fx > 0.0 && intrinsics.fy > 0.0,
                  "a camera sees something");
  const auto padded = [](int count, int step) { return (count + step - 1) / step * step; };
  stride_ = padded(intrinsics.width, kTileWidth);
  rows_ = padded(intrinsics.height, kTileHeight);
  x_.resize(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(rows_));
  y_.resize(x_.size());
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < stride_; ++column) {
      const int u = std::min(column, intrinsics.width - 1),
                v = std::min(row, intrinsics.height - 1);  // padding repeats the rim
      const Eigen::Vector2d p = normalised(u, v);
      const std::size_t at =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(stride_) + static_cast<std::size_t>(column);
      x_[at] = static_cast<float>(p.x());
      y_[at] = static_cast<float>(p.y());
      greatest_square_ = std::max(greatest_square_, p.squaredNorm());
    }
  }
  const float infinite = std::numeric_limits<float>::infinity();
  bounds_ = {infinite, -infinite, infinite, -infinite};
  for (int top = 0; top < rows_; top += kTileHeight) {
    for (int left = 0; left < stride_; left += kTileWidth) {
      Bounds tile{infinite, -infinite, infinite, -infinite};
      const auto include = [](Bounds& b, float low_x, float high_x, float low_y, float high_y) {
        b = {std::min(b.low_x, low_x), std::max(b.high_x, high_x), std::min(b.low_y, low_y),
             std::max(b.high_y, high_y)};
      };
      for (int row = top; row < top + kTileHeight; ++row) {
        for (int column = left; column < left + kTileWidth; ++column)
          include(tile, x(row)[column], x(row)[column], y(row)[column], y(row)[column]);
      }
      tiles_.push_back(tile);
      include(bounds_, tile.low_x, tile.high_x, tile.low_y, tile.high_y);
    }
  }
}

std::optional<Eigen::Vector2d> CameraModel::project(const Eigen::Vector3d& point) const {
  if (point.z() <= 0.0) return std::nullopt;
  const Eigen::Vector2d p = point.head<2>() / point.z();
  if (p.squaredNorm() > greatest_square_ * 1.01) return std::nullopt;  // where distortion may fold the plane over
  const Eigen::Vector2d d = distorted(p, intrinsics_.distortion);
  const Eigen::Vector2d pixel(intrinsics_.fx * d.x() + intrinsics_.cx, intrinsics_.fy * d.y() + intrinsics_.cy);
  const bool is_inside = pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < intrinsics_.width - 0.5 &&
                         pixel.y() < intrinsics_.height - 0.5;
  return is_inside ? std::optional(pixel) : std::nullopt;
}

Eigen::Vector2d CameraModel::normalised(double u, double v) const {
  const Eigen::Vector2d wanted((u - intrinsics_.cx) / intrinsics_.fx, (v - intrinsics_.cy) / intrinsics_.fy);
  if (!intrinsics_.is_distorted()) return wanted;
  Eigen::Vector2d p = wanted;
  for (int iteration = 0; iteration < 20; ++iteration) {  // Newton, with differences for derivatives
    constexpr double kStep = 1e-6;
    const Eigen::Vector2d value = distorted(p, intrinsics_.distortion), error = value - wanted;
    if (error.norm() < 1e-12) return p;
    Eigen::Matrix2d slope;
    slope.col(0) = (distorted(p + Eigen::Vector2d(kStep, 0.0), intrinsics_.distortion) - value) / kStep;
    slope.col(1) = (distorted(p + Eigen::Vector2d(0.0, kStep), intrinsics_.distortion) - value) / kStep;
    if (slope.determinant() < 1e-3) break;
    p -= slope.inverse() * error;
  }
  const double miss = (distorted(p, intrinsics_.distortion) - wanted).norm();
  if (miss < 1e-9 && p.norm() < 10.0) return p;
  throw Error(ErrorCode::kBadInput,
              "the distortion folds the picture over itself at pixel " + std::to_string(u) + ", " + std::to_string(v),
              "camera", "check k1, k2, p1, p2, k3");
}

}  // namespace mapweave::simulation
