#pragma once
// Planar covariances carried from one frame to another.

#include <mapweave/maps/judgement.h>

namespace mapweave {

// A small motion (x, y, yaw) of frame b in its own axes, as seen in a's axes: motion_in_a = adjoint(a_from_b) *
// motion_in_b.
Eigen::Matrix3d adjoint(const Pose2& a_from_b);
// The same planar alignment, of a in b, with its covariance.
Alignment inverse(const Alignment& a_from_b);

}  // namespace mapweave
