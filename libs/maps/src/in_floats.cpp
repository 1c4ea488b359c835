#include <mapweave/maps/in_floats.h>

namespace mapweave {
namespace {

constexpr double kDiagonalGrowth = 1e-6;  // more than three roundings of 6e-8 can take from an eigenvalue

}  // namespace

double in_float(double number) {
  // volatile: GCC 12 takes two such roundings side by side for none.
  const volatile float rounded = static_cast<float>(number);
  return static_cast<double>(rounded);
}

Pose2 in_floats(const Pose2& pose) { return {in_float(pose.x), in_float(pose.y), in_float(pose.phi)}; }

Pose3 in_floats(const Pose3& planar_pose) { return spatial(in_floats(planar(planar_pose))); }

Eigen::Matrix3d in_floats(const Eigen::Matrix3d& information) {
  Eigen::Matrix3d rounded;
  for (int row = 0; row < 3; ++row)
    for (int column = row; column < 3; ++column) {
      const double number = 0.5 * (information(row, column) + information(column, row));
      rounded(row, column) = rounded(column, row) = in_float(row == column ? (1.0 + kDiagonalGrowth) * number : number);
    }
  return rounded;
}

}  // namespace mapweave
