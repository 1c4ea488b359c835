#pragma once
// A pinhole camera with radial-tangential distortion (Brown 1966; the parameters of OpenCV: k1 k2 p1 p2 k3). Camera
// frame: z ahead, x to the right, y down. Pixels: (0, 0) is the middle of the upper left one. "Normalised" is the plane
// z = 1, undistorted.

#include <mapweave/core/geometry.h>

#include <array>
#include <optional>
#include <vector>

namespace mapweave::simulation {

struct CameraIntrinsics {
  int width = 640, height = 480;
  double fx = 525.0, fy = 525.0, cx = 319.5, cy = 239.5;  // pixels
  std::array<double, 5> distortion{};
  bool is_distorted() const;
};

// Immutable; may be used by many threads.
class CameraModel {
 public:
  // Throws Error kBadInput where the distortion cannot be undone within the picture.
  explicit CameraModel(const CameraIntrinsics& intrinsics);
  const CameraIntrinsics& intrinsics() const { return intrinsics_; }
  // The pixel, or none where the point is behind or outside of the picture.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_in_camera) const;
  Eigen::Vector2d normalised(double u, double v) const;

  // Normalised coordinates of every pixel, row by row; rows are padded to `stride`, and there are whole tiles of rows.
  static constexpr int kTileWidth = 64, kTileHeight = 16;
  struct Bounds {
    float low_x, high_x, low_y, high_y;
  };
  int stride() const { return stride_; }
  int padded_rows() const { return rows_; }
  const float* x(int row) const { return x_.data() + static_cast<std::ptrdiff_t>(row) * stride_; }
  const float* y(int row) const { return y_.data() + static_cast<std::ptrdiff_t>(row) * stride_; }
  const std::vector<Bounds>& tiles() const { return tiles_; }  // row by row
  const Bounds& bounds() const { return bounds_; }             // of them all

 private:
  CameraIntrinsics intrinsics_;
  int stride_ = 0, rows_ = 0;
  double greatest_square_ = 0.0;  // of normalised radii in the picture
  std::vector<float> x_, y_;
  std::vector<Bounds> tiles_;
  Bounds bounds_{};
};

}  // namespace mapweave::simulation
