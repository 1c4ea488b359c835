#include "rig_parts.h"
#include "lengths.h"

#include <mapweave/matching/rigid_from_points.h>

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {

double turn_rad(const Pose3& pose) { return 2.0 * std::acos(std::min(1.0, std::abs(pose.q.w()))); }

std::optional<VirtualKeyframe> virtual_keyframe(const Part& part, Stamp stamp, const RigOptions& options) {
  const auto& poses = part.poses;
  const auto later = std::lower_bound(poses.begin(), poses.end(), stamp, [](const StampedPose& p, Stamp s) { return p.stamp < s; });
  if (later == poses.end() || (later == poses.begin() && later->stamp != stamp)) return std::nullopt;
  const auto after = static_cast<std::size_t>(later - poses.begin()), before = after - (later->stamp == stamp ? 0 : 1);
  const double gap_s = seconds_between(poses[before].stamp, poses[after].stamp);
  if (gap_s > options.longest_gap_s) return std::nullopt;
  const double share = gap_s > 0.0 ? seconds_between(poses[before].stamp, stamp) / gap_s : 0.0;
  const double bend_s2 = 0.5 * share * (1.0 - share) * gap_s * gap_s;
  return VirtualKeyframe{interpolated(poses[before].map_from_robot, poses[after].map_from_robot, share),
                         interpolated(part.placed[before].map_from_robot, part.placed[after].map_from_robot, share),
                         options.tie_m + bend_s2 * options.acceleration_m_per_s2,
                         options.tie_rad + bend_s2 * options.acceleration_rad_per_s2};
}

Common common_with(const std::vector<Part>& parts, const std::vector<std::size_t>& siblings, std::size_t part, const RigOptions& options) {
  Common common;
  for (const StampedPose& pose : parts[part].poses)
    for (const std::size_t sibling : siblings) {
      if (parts[sibling].camera == parts[part].camera) continue;
      const auto seen = virtual_keyframe(parts[sibling], pose.stamp, options);
      if (!seen) continue;
      const double since_s = common.moments.empty() ? 0.0 : seconds_between(common.moments.back().stamp, pose.stamp);
      if (since_s <= options.longest_gap_s) common.seconds += since_s;
      common.moments.push_back({pose.stamp, sibling, {seen->group_from_robot, pose.map_from_robot}});
      break;
    }
  return common;
}

std::vector<Stretch> stretches(const std::vector<Moment>& m, const Part& part) {
  constexpr double kLeast_m = 0.3, kLeast_rad = 0.3, kLongest_s = 10.0;
  std::vector<Stretch> result;
  for (std::size_t first = 0, i = 1; i < m.size(); ++i) {
    if (m[i].sibling != m[first].sibling || seconds_between(m[first].stamp, m[i].stamp) > kLongest_s) {
      first = i;
      continue;
    }
    const Stretch stretch{between(m[first].pose.in_a, m[i].pose.in_a), between(m[first].pose.in_b, m[i].pose.in_b), m[first].stamp,
                          m[i].stamp};
    if (stretch.by_sibling.t.norm() < kLeast_m && turn_rad(stretch.by_sibling) < kLeast_rad) continue;
    result.push_back(stretch);
    first = i;
  }
  if (part.metric) return result;
  // Lengths of a camera without depth change as it goes: those around tell.
  constexpr std::size_t kAround = 4;
  const Pose3& mounted = part.robot_from_camera;
  const auto by_camera_m = [&](const Pose3& way) { return compose(compose(inverse(mounted), way), mounted).t.norm(); };
  for (std::size_t i = 0; i < result.size(); ++i) {
    double sibling_m = 0.0, part_m = 0.0;
    for (std::size_t k = i > kAround ? i - kAround : 0; k < std::min(result.size(), i + kAround + 1); ++k)
      sibling_m += by_camera_m(result[k].by_sibling), part_m += by_camera_m(result[k].by_part);
    if (part_m > 0.0 && sibling_m > 0.0) result[i].scale = sibling_m / part_m;
  }
  for (Stretch& stretch : result) stretch.by_part = in_lengths(stretch.by_part, mounted, stretch.scale);
  return result;
}

bool contradicts(const Stretch& stretch, const RigOptions& options) {
  const double way_m = std::max(stretch.by_sibling.t.norm(), stretch.by_part.t.norm());
  return (stretch.by_sibling.t - stretch.by_part.t).norm() > options.wrong_m + options.wrong_share * way_m ||
         turn_rad(between(stretch.by_sibling, stretch.by_part)) > options.wrong_rad;
}

std::optional<double> wrong_turn_rad(const std::vector<Stretch>& all, const RigOptions& options) {
  std::vector<matching::PointPair> ends;
  for (const Stretch& stretch : all)
    for (const double sign : {1.0, -1.0}) ends.push_back({sign * stretch.by_sibling.t, sign * stretch.by_part.t, 1.0});
  constexpr double kUp_m = 1.0;  // turns about the vertical alone are looked for
  for (const double up : {kUp_m, -kUp_m}) ends.push_back({{0, 0, up}, {0, 0, up}, 10.0 * static_cast<double>(all.size())});
  const auto turn = matching::align_points(ends, matching::Freedom::rigid);
  if (!turn) return std::nullopt;
  const auto wrong = std::count_if(all.begin(), all.end(), [&](Stretch stretch) {
    stretch.by_part.t = turn->pose.q * stretch.by_part.t;
    return contradicts(stretch, options);
  });
  if (static_cast<double>(wrong) > options.most_wrong * static_cast<double>(all.size())) return std::nullopt;
  return planar(turn->pose).phi;
}

void place(Part& part, const Pose3& group_from_own) {
  for (MovedKeyframe& keyframe : part.keyframes) keyframe.after = compose(group_from_own, keyframe.before), keyframe.scale = 1.0;
  part.placed = carried_along(part.poses, part.keyframes);
}

void place(Part& part, const std::vector<Moment>& moments, const std::vector<Stretch>& stretches, double scale) {
  std::vector<PosePair> pairs;
  for (const Moment& moment : moments) pairs.push_back(moment.pose);
  if (part.metric) return place(part, aligned(pairs, 1.0).pose);
  const auto nearest = [](const auto& all, Stamp stamp, const auto& stamp_of) {
    return std::min_element(all.begin(), all.end(), [&](const auto& a, const auto& b) {
      return std::abs(stamp_of(a).ns - stamp.ns) < std::abs(stamp_of(b).ns - stamp.ns);
    });
  };
  for (MovedKeyframe& keyframe : part.keyframes) {
    const auto stretch = nearest(stretches, keyframe.stamp, [](const Stretch& s) { return Stamp{(s.begin.ns + s.end.ns) / 2}; });
    const Moment& moment = *nearest(moments, keyframe.stamp, [](const Moment& m) { return m.stamp; });
    keyframe.scale = stretch == stretches.end() ? scale : stretch->scale;
    keyframe.after =
        compose(moment.pose.in_a, in_lengths(between(moment.pose.in_b, keyframe.before), part.robot_from_camera, keyframe.scale));
  }
  part.placed = carried_along(part.poses, part.keyframes);
}

}  // namespace mapweave::fusion
