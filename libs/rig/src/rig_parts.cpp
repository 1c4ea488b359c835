#include "rig_parts.h"

#include <mapweave/matching/rigid_from_points.h>
#include <mapweave/rig/scale.h>

#include <algorithm>
#include <cmath>

namespace mapweave::rig {

double turn_rad(const Pose3& pose) { return 2.0 * std::acos(std::min(1.0, std::abs(pose.q.w()))); }

std::optional<VirtualKeyframe> virtual_keyframe(const RigPart& part, Stamp stamp, const RigOptions& options) {
  const auto& poses = part.poses;
  const auto later =
      std::lower_bound(poses.begin(), poses.end(), stamp, [](const StampedPose& p, Stamp s) { return p.stamp < s; });
  if (later == poses.end() || (later == poses.begin() && later->stamp != stamp)) return std::nullopt;
  const auto after = static_cast<std::size_t>(later - poses.begin()), before = after - (later->stamp == stamp ? 0 : 1);
  const double gap_s = seconds_between(poses[before].stamp, poses[after].stamp);
  if (gap_s > options.longest_gap_s) return std::nullopt;
  const double share = gap_s > 0.0 ? seconds_between(poses[before].stamp, stamp) / gap_s : 0.0;
  const double bend_s2 = 0.5 * share * (1.0 - share) * gap_s * gap_s;
  return VirtualKeyframe{interpolated(poses[before].map_from_robot, poses[after].map_from_robot, share),
                         interpolated(part.placed[before].map_from_robot, part.placed[after].map_from_robot, share),
                         options.extrinsic_sigma_m + bend_s2 * options.acceleration_m_per_s2,
                         options.extrinsic_sigma_rad + bend_s2 * options.acceleration_rad_per_s2};
}

CommonTime common_with(const std::vector<RigPart>& parts, const std::vector<std::size_t>& group, std::size_t part,
                       const RigOptions& options) {
  CommonTime common;
  for (const StampedPose& pose : parts[part].poses)
    for (const std::size_t other : group) {
      if (parts[other].camera == parts[part].camera) continue;
      const auto seen = virtual_keyframe(parts[other], pose.stamp, options);
      if (!seen) continue;
      const double since_s = common.moments.empty() ? 0.0 : seconds_between(common.moments.back().stamp, pose.stamp);
      if (since_s <= options.longest_gap_s) common.seconds += since_s;
      common.moments.push_back({pose.stamp, other, {seen->group_from_robot, pose.map_from_robot}});
      break;
    }
  return common;
}

std::vector<CommonMotion> common_motions(const std::vector<CommonMoment>& m, const RigPart& part) {
  // Shorter motions contradict nothing; over longer times they drift.
  constexpr double kLeast_m = 0.3, kLeast_rad = 0.3, kLongest_s = 10.0;
  std::vector<CommonMotion> result;
  for (std::size_t first = 0, i = 1; i < m.size(); ++i) {
    if (m[i].other != m[first].other || seconds_between(m[first].stamp, m[i].stamp) > kLongest_s) {
      first = i;
      continue;
    }
    const CommonMotion motion{between(m[first].pose.in_a, m[i].pose.in_a), between(m[first].pose.in_b, m[i].pose.in_b),
                              m[first].stamp, m[i].stamp};
    if (motion.by_other.t.norm() < kLeast_m && turn_rad(motion.by_other) < kLeast_rad) continue;
    result.push_back(motion);
    first = i;
  }
  if (part.metric) return result;
  // The scale of a camera without depth drifts: it is averaged over the motions around.
  constexpr std::size_t kAround = 4;
  const Pose3& robot_from_camera = part.robot_from_camera;
  const auto by_camera_m = [&](const Pose3& motion) {
    return compose(compose(inverse(robot_from_camera), motion), robot_from_camera).t.norm();
  };
  for (std::size_t i = 0; i < result.size(); ++i) {
    double other_m = 0.0, part_m = 0.0;
    for (std::size_t k = i > kAround ? i - kAround : 0; k < std::min(result.size(), i + kAround + 1); ++k) {
      other_m += by_camera_m(result[k].by_other);
      part_m += by_camera_m(result[k].by_part);
    }
    if (part_m > 0.0 && other_m > 0.0) result[i].scale = other_m / part_m;
  }
  for (CommonMotion& motion : result) motion.by_part = rescaled(motion.by_part, robot_from_camera, motion.scale);
  return result;
}

bool contradicts(const CommonMotion& motion, const RigOptions& options) {
  const double length_m = std::max(motion.by_other.t.norm(), motion.by_part.t.norm());
  return (motion.by_other.t - motion.by_part.t).norm() > options.wrong_m + options.wrong_share * length_m ||
         turn_rad(between(motion.by_other, motion.by_part)) > options.wrong_rad;
}

std::optional<double> wrong_turn_rad(const std::vector<CommonMotion>& all, const RigOptions& options) {
  std::vector<matching::PointPair> ends;
  for (const CommonMotion& motion : all)
    for (const double sign : {1.0, -1.0}) ends.push_back({sign * motion.by_other.t, sign * motion.by_part.t, 1.0});
  constexpr double kUp_m = 1.0;  // turns about the vertical alone are looked for
  for (const double up : {kUp_m, -kUp_m})
    ends.push_back({{0, 0, up}, {0, 0, up}, 10.0 * static_cast<double>(all.size())});
  const auto turn = matching::align_points(ends, matching::Freedom::rigid);
  if (!turn) return std::nullopt;
  const auto wrong = std::count_if(all.begin(), all.end(), [&](CommonMotion motion) {
    motion.by_part.t = turn->pose.q * motion.by_part.t;
    return contradicts(motion, options);
  });
  if (static_cast<double>(wrong) > options.most_wrong * static_cast<double>(all.size())) return std::nullopt;
  return planar(turn->pose).phi;
}

void place(RigPart& part, const Pose3& group_from_own) {
  for (MovedKeyframe& keyframe : part.keyframes) {
    keyframe.after = compose(group_from_own, keyframe.before);
    keyframe.scale = 1.0;
  }
  part.placed = moved_with_keyframes(part.poses, part.keyframes);
}

void place(RigPart& part, const std::vector<CommonMoment>& moments, const std::vector<CommonMotion>& motions,
           double scale) {
  std::vector<CommonPose> pairs;
  for (const CommonMoment& moment : moments) pairs.push_back(moment.pose);
  if (part.metric) return place(part, aligned(pairs, 1.0).pose);
  const auto nearest = [](const auto& all, Stamp stamp, const auto& stamp_of) {
    return std::min_element(all.begin(), all.end(), [&](const auto& a, const auto& b) {
      return std::abs(stamp_of(a).ns - stamp.ns) < std::abs(stamp_of(b).ns - stamp.ns);
    });
  };
  for (MovedKeyframe& keyframe : part.keyframes) {
    const auto motion =
        nearest(motions, keyframe.stamp, [](const CommonMotion& m) { return Stamp{(m.begin.ns + m.end.ns) / 2}; });
    const CommonMoment& moment = *nearest(moments, keyframe.stamp, [](const CommonMoment& m) { return m.stamp; });
    keyframe.scale = motion == motions.end() ? scale : motion->scale;
    keyframe.after = compose(
        moment.pose.in_a, rescaled(between(moment.pose.in_b, keyframe.before), part.robot_from_camera, keyframe.scale));
  }
  part.placed = moved_with_keyframes(part.poses, part.keyframes);
}

}  // namespace mapweave::rig
