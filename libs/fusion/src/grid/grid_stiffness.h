#pragma once
// How firmly two places of one grid hold each other. Real grids bend: measured on those of one building by 14 visits
// (DECISIONS.md, 60).

#include <mapweave/core/geometry.h>
#include <mapweave/maps/alignment.h>

namespace mapweave::fusion {

constexpr double kGridTile_m = 5.0;  // the pieces in which grids are bent
constexpr double kGridBend_m = 0.07,
                 kGridBend_rad = 0.014;  // standard deviation of one grid over such a piece, as seen from the middle

// Of two places of a grid, or of `grids` that are laid on each other and bend both: x, y, yaw in the frame of the
// second place.
inline Eigen::Matrix3d grid_stiffness(double step_x_m, double step_y_m, int grids = 1) {
  const double pieces = std::max(1.0, std::hypot(step_x_m, step_y_m) / kGridTile_m);
  const Eigen::Vector3d sigma(kGridBend_m, kGridBend_m, kGridBend_rad);
  const Eigen::Matrix3d middle_from_second = adjoint(Pose2(step_x_m / 2.0, step_y_m / 2.0, 0.0));
  return middle_from_second.transpose() * (grids * pieces * sigma.cwiseAbs2()).cwiseInverse().asDiagonal() *
         middle_from_second;
}

}  // namespace mapweave::fusion
