#pragma once
// Brings an estimated trajectory beside its reference: which points belong together in time, and the motion that lays
// one on the other.

#include <mapweave/evaluation/trajectory.h>

#include <optional>
#include <vector>

namespace mapweave::evaluation {

enum class AlignmentKind {
  none,  // frames are the same already
  se2,   // x, y, yaw; heights stay
  se3,   // rigid
  sim3,  // rigid, and a scale: for a single camera
};

struct PosePair {
  Stamp stamp;  // of the estimate
  Pose3 reference, estimate;
};

// For each point of the shorter trajectory (of two equally long: the estimate) the nearest in time of the longer; those
// farther apart than `max_difference_s` are left out. evo's rule.
std::vector<PosePair> associated(const Trajectory& estimate, const Trajectory& reference, double max_difference_s);

// The motion that minimises the sum of squared distances of the positions. Umeyama, PAMI 1991; se2: the same in the x-y
// plane, without scale. Throws Error(kBadInput) where the positions do not fix it: all in one place (se2), or all on
// one line (se3, sim3).
Sim3 reference_from_estimate(const std::vector<PosePair>&, AlignmentKind);

// A rotation between the orientations of the whole trajectory: estimate and reference follow different bodies, as a
// robot and its camera's optical frame.
struct ConstantRotation {
  Eigen::Quaterniond reference_body_from_estimate_body;
  double angle_deg = 0.0;
  double spread_deg = 0.0;  // of the orientations about it, root of the mean square
};

// Of pairs that are aligned. nullopt where there is none to speak of: below 3 degrees, or less than three times its
// spread.
std::optional<ConstantRotation> constant_rotation(const std::vector<PosePair>& aligned);

// How cameras look that look ahead: x right, y down, z forward, on a robot with x forward, y left, z up.
Pose3 robot_from_optical();

}  // namespace mapweave::evaluation
