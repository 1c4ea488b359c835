#pragma once
// Sessions of a robot's cameras beside each other: where they were at the same times, and whether they tell the same way.

#include "aligned_ways.h"

#include <mapweave/fusion/rig.h>

#include <optional>

namespace mapweave::fusion {

struct Part {
  std::string camera;
  const Map* map = nullptr;
  bool metric = false, taken = false, wheels = false;
  std::vector<StampedPose> poses, placed;  // that are known: in the part's own map, and in the group's once it has one
  std::vector<MovedKeyframe> keyframes;    // by stamp: from the one map into the other
  std::vector<NodeId> ids;                 // of the keyframes
  Pose3 robot_from_camera;
};

double turn_rad(const Pose3& pose);

// A camera at another one's stamp.
struct VirtualKeyframe {
  Pose3 own_from_robot, group_from_robot;  // the latter once it is placed
  double sigma_m, sigma_rad;
};
std::optional<VirtualKeyframe> virtual_keyframe(const Part& part, Stamp stamp, const RigOptions& options);

// What a part has in common with siblings that lie in a group.
struct Moment {
  Stamp stamp;
  std::size_t sibling;
  PosePair pose;  // of the robot: in the group, and by the part
};
struct Common {
  std::vector<Moment> moments;
  double seconds = 0.0;
};
// `siblings`: numbers of parts that are placed; each moment is of the first of them that was there.
Common common_with(const std::vector<Part>& parts, const std::vector<std::size_t>& siblings, std::size_t part, const RigOptions& options);

// A piece of the way that both tell, in which the robot moved. `scale`: by which the part's lengths there are to grow.
struct Stretch {
  Pose3 by_sibling, by_part;  // the latter with that scale
  Stamp begin, end;
  double scale = 1.0;
};
std::vector<Stretch> stretches(const std::vector<Moment>& moments, const Part& part);
bool contradicts(const Stretch& stretch, const RigOptions& options);
// By how much more the part's camera would have to be turned to the left, for its motions to be the sibling's.
std::optional<double> wrong_turn_rad(const std::vector<Stretch>& all, const RigOptions& options);

// Puts a part beside its siblings: a rigid whole where it measures lengths, else keyframe by keyframe, with the lengths that they have
// there.
void place(Part& part, const std::vector<Moment>& moments, const std::vector<Stretch>& stretches, double scale);
void place(Part& part, const Pose3& group_from_own);

}  // namespace mapweave::fusion
