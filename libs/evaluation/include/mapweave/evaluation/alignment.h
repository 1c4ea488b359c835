#pragma once
// Brings an estimated trajectory beside its reference: which points belong together in time, and the motion that lays
// one on the other.

#include <mapweave/evaluation/trajectory.h>

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

}  // namespace mapweave::evaluation
