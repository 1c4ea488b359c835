#pragma once
// Sessions of a robot's cameras compared: their poses at the same times, and whether they agree on the motion in
// between.

#include <mapweave/rig/aligned_trajectories.h>
#include <mapweave/rig/rig.h>

#include <optional>

namespace mapweave::rig {

// A session of a camera, or wheel odometry, that is placed in the map of a group.
struct RigPart {
  std::string camera;
  const Map* map = nullptr;
  bool metric = false, taken = false, wheels = false;
  std::vector<StampedPose> poses, placed;  // in the part's own map, and in the group's once it has one
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
std::optional<VirtualKeyframe> virtual_keyframe(const RigPart& part, Stamp stamp, const RigOptions& options);

// The robot at one time, by a part of a group and by another part.
struct CommonMoment {
  Stamp stamp;
  std::size_t other;  // number of the part of the group
  CommonPose pose;    // in the group, and by the part itself
};
struct CommonTime {
  std::vector<CommonMoment> moments;
  double seconds = 0.0;
};
// `group`: numbers of parts that are placed; each moment is of the first of them that has a pose there.
CommonTime common_with(const std::vector<RigPart>& parts, const std::vector<std::size_t>& group, std::size_t part,
                       const RigOptions& options);

// A motion of the robot by two parts. `scale`: by which the part is rescaled there.
struct CommonMotion {
  Pose3 by_other, by_part;  // the latter rescaled
  Stamp begin, end;
  double scale = 1.0;
};
std::vector<CommonMotion> common_motions(const std::vector<CommonMoment>& moments, const RigPart& part);
bool contradicts(const CommonMotion& motion, const RigOptions& options);
// The angle to the left by which the extrinsics of the part's camera must be turned for its motions to agree with the
// other's. nullopt where no angle does that.
std::optional<double> wrong_turn_rad(const std::vector<CommonMotion>& all, const RigOptions& options);

// Places a part in the group: rigidly where it is metric, else keyframe by keyframe, each with the scale of the motions
// around it.
void place(RigPart& part, const std::vector<CommonMoment>& moments, const std::vector<CommonMotion>& motions,
           double scale);
void place(RigPart& part, const Pose3& group_from_own);

}  // namespace mapweave::rig
