#pragma once
// Poses from the fewest points: absolute orientation from points that both sides know, and the pose of a camera from
// three points that it sees.

#include <mapweave/core/geometry.h>

#include <array>
#include <optional>
#include <vector>

namespace mapweave::matching {

enum class Freedom { rigid, similarity };

struct PointPair {
  Eigen::Vector3d in_a, in_b;
  double weight = 1.0;  // positive
};

// a_from_b of least squares (Horn: Closed-form solution of absolute orientation using unit quaternions, JOSA A 4(4),
// 1987; scale by his symmetric form, section 2.E, which errs alike in both directions). nullopt where the points do not
// determine the rotation: fewer than three, all in a line or at one place; or where they are no numbers.
std::optional<Sim3> align_points(const std::vector<PointPair>& pairs, Freedom freedom);

// Poses camera_from_world of a camera that sees three points of the world along three rays (unit vectors in the
// camera's frame), at most four, each with all points in front. The method is that of Persson, Nordberg: Lambda Twist,
// an accurate fast robust perspective three point solver, ECCV 2018. Empty where points or rays are in a line.
std::vector<Pose3> poses_from_three_points(const std::array<Eigen::Vector3d, 3>& rays_in_camera,
                                           const std::array<Eigen::Vector3d, 3>& points_in_world);

}  // namespace mapweave::matching
