#include "rig_graph.h"

#include <mapweave/core/format.h>
#include <mapweave/rig/scale.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace mapweave::rig {
namespace {

class RigMerger {
 public:
  RigMerger(const std::vector<RigMember>& members, const std::vector<StampedPose>& odometry, const RigOptions& options)
      : members_(members), odometry_(odometry), options_(options), parts_(members.size()) {
    for (std::size_t i = 0; i < members.size(); ++i) {
      RigPart& part = parts_[i];
      part.camera = members[i].camera;
      part.map = &members[i].map;
      part.metric = is_metric(members[i].map);
      part.taken = members[i].map.nodes.empty();
      std::vector<const Node*> keyframes;
      for (const auto& [id, node] : members[i].map.nodes) keyframes.push_back(&node);
      std::stable_sort(keyframes.begin(), keyframes.end(),
                       [](const Node* a, const Node* b) { return a->stamp < b->stamp; });
      part.poses = members[i].frames;
      for (const Node* node : keyframes) {
        if (const KeyframeFeatures* keyframe = keyframe_of(*node))
          part.robot_from_camera = keyframe->geometry->robot_from_camera;
        part.keyframes.push_back({node->stamp, node->map_from_node, node->map_from_node, 1.0, part.robot_from_camera});
        part.ids.push_back(node->id);
        if (members[i].frames.empty()) part.poses.push_back({node->stamp, node->map_from_node});
      }
      place(part, Pose3());
    }
  }

  RigMerge run() {
    for (;;) {
      const std::size_t base = next_base();
      if (base == parts_.size()) break;
      parts_[base].taken = true;
      const std::vector<std::size_t> group = gathered(base);
      if (group.size() == 1)
        result_.maps.push_back({members_[base].map, group, {parts_[base].poses}});
      else
        result_.maps.push_back(merged(group));
    }
    for (const auto& [number, why] : why_apart_) {
      const std::string note =
          why.what + (other_session_joined(number) ? "it was led astray, for at other times they agree" : why.advice);
      if (std::find(result_.notes.begin(), result_.notes.end(), note) == result_.notes.end())
        result_.notes.push_back(note);
    }
    std::stable_sort(result_.maps.begin(), result_.maps.end(),
                     [&](const RigMap& a, const RigMap& b) { return poses_of(a) > poses_of(b); });
    return std::move(result_);
  }

 private:
  std::size_t poses_of(const RigMap& map) const {
    std::size_t sum = 0;
    for (const std::size_t m : map.members) sum += parts_[m].poses.size();
    return sum;
  }

  bool other_session_joined(std::size_t number) const {
    return std::any_of(result_.maps.begin(), result_.maps.end(), [&](const RigMap& map) {
      return map.members.size() > 1 && std::any_of(map.members.begin(), map.members.end(), [&](std::size_t m) {
               return parts_[m].camera == parts_[number].camera;
             });
    });
  }

  // Metric maps come first.
  std::size_t next_base() const {
    std::size_t best = parts_.size();
    const auto rank = [&](std::size_t i) { return std::make_pair(parts_[i].metric, parts_[i].poses.size()); };
    for (std::size_t i = 0; i < parts_.size(); ++i)
      if (!parts_[i].taken && (best == parts_.size() || rank(i) > rank(best))) best = i;
    return best;
  }

  RigMap merged(std::vector<std::size_t> group) {
    if (parts_[group.front()].metric || !scale_by_odometry(group))
      return solve_rig_graph(parts_, group, odometry_, options_);
    group.push_back(parts_.size() - 1);
    RigMap result = solve_rig_graph(parts_, group, odometry_, options_);
    result.members.pop_back();
    result.frames.pop_back();
    parts_.pop_back();
    return result;
  }

  // Where no camera is metric, wheel odometry gives the scale: it becomes the last part of the group, and the others
  // are placed along it.
  bool scale_by_odometry(const std::vector<std::size_t>& group) {
    RigPart wheels;
    wheels.metric = true;
    wheels.wheels = true;
    wheels.map = &no_map_;
    wheels.poses = odometry_;
    const SessionId session{{parts_[group.front()].ids.front().session.client.robot, SensorId("wheels")}, 0};
    for (std::size_t i = 0; i < odometry_.size(); ++i) {
      if (!wheels.keyframes.empty() && seconds_between(wheels.keyframes.back().stamp, odometry_[i].stamp) < 0.5)
        continue;
      wheels.ids.push_back({session, static_cast<std::uint32_t>(wheels.ids.size())});
      wheels.keyframes.push_back({odometry_[i].stamp, odometry_[i].map_from_robot, odometry_[i].map_from_robot});
    }
    if (wheels.ids.empty()) return false;
    const RigPart& first = parts_[group.front()];
    const auto there = pose_at(odometry_, first.poses.front().stamp, options_.longest_gap_s);
    if (!there) return false;
    place(wheels, compose(first.placed.front().map_from_robot, inverse(*there)));
    parts_.push_back(std::move(wheels));
    std::vector<std::pair<std::size_t, CommonTime>> along;
    for (const std::size_t m : group) along.emplace_back(m, common_with(parts_, {parts_.size() - 1}, m, options_));
    const bool all_scaled = std::all_of(along.begin(), along.end(), [&](const auto& entry) {
      return entry.second.seconds >= options_.least_common_s && scale_of(entry.second, parts_[entry.first]);
    });
    if (!all_scaled) {
      parts_.pop_back();
      return false;
    }
    for (const auto& [m, common] : along)
      place(parts_[m], common.moments, common_motions(common.moments, parts_[m]), *scale_of(common, parts_[m]));
    return true;
  }

  // All that can be placed beside the base, those first that have most in common with what is there.
  std::vector<std::size_t> gathered(std::size_t base) {
    std::vector<std::size_t> group{base};
    std::set<std::size_t> refused;
    if (!options_.enabled) return group;
    for (;;) {
      CommonTime most;
      std::size_t next = parts_.size();
      for (std::size_t i = 0; i < parts_.size(); ++i) {
        if (parts_[i].taken || refused.count(i) != 0) continue;
        CommonTime common = common_with(parts_, group, i, options_);
        if (common.seconds < options_.least_common_s || common.seconds <= most.seconds) continue;
        most = std::move(common);
        next = i;
      }
      if (next == parts_.size()) return group;
      if (joins(next, most)) {
        parts_[next].taken = true;
        why_apart_.erase(next);
        group.push_back(next);
        refused.clear();  // there is more to compare with now
      } else {
        refused.insert(next);
      }
    }
  }

  // By the trajectory of its camera.
  static std::optional<double> scale_of(const CommonTime& common, const RigPart& part) {
    std::vector<CommonPose> pairs;
    for (const CommonMoment& moment : common.moments)
      pairs.push_back(
          {compose(moment.pose.in_a, part.robot_from_camera), compose(moment.pose.in_b, part.robot_from_camera)});
    return scale_of_trajectories(pairs);
  }

  bool joins(std::size_t number, const CommonTime& common) {
    RigPart& part = parts_[number];
    const std::optional<double> scale = part.metric ? std::optional(1.0) : scale_of(common, part);
    if (!scale) {
      why_apart_[number] = {
          "the map of camera '" + part.camera + "', which has no depth, stays apart: ",
          "the robot hardly moved while another camera of the rig saw where, so its scale is not known"};
      return false;
    }
    constexpr double kLeastLength_m = 0.1;  // turns on the spot say little of a camera's extrinsics
    const std::vector<CommonMotion> all = common_motions(common.moments, part);
    const auto informative = std::count_if(all.begin(), all.end(), [&](const CommonMotion& motion) {
      return motion.by_other.t.norm() > kLeastLength_m || contradicts(motion, options_);
    });
    const auto wrong = std::count_if(all.begin(), all.end(),
                                     [&](const CommonMotion& motion) { return contradicts(motion, options_); });
    if (static_cast<double>(wrong) > options_.most_wrong * static_cast<double>(informative)) {
      const std::string other = parts_[common.moments.front().other].camera;
      WhyApart& why = why_apart_[number];
      why.what = format(
          "cameras '%s' and '%s' contradict each other in %d of %d stretches of their path, and their maps stay "
          "apart: ",
          other.c_str(), part.camera.c_str(), static_cast<int>(wrong), static_cast<int>(informative));
      if (const auto turn = wrong_turn_rad(all, options_))
        why.advice = format("they would agree if '%s' were mounted %.0f deg farther to the %s than the log says",
                            part.camera.c_str(), std::abs(*turn) * 180.0 / M_PI, *turn > 0.0 ? "left" : "right");
      else
        why.advice = "see how they are mounted, whether their clocks agree, and what they saw";
      return false;
    }
    place(part, common.moments, all, *scale);
    return true;
  }

  const std::vector<RigMember>& members_;
  const std::vector<StampedPose>& odometry_;
  const RigOptions& options_;
  const Map no_map_;
  std::vector<RigPart> parts_;
  struct WhyApart {
    std::string what, advice;
  };
  std::map<std::size_t, WhyApart> why_apart_;
  RigMerge result_;
};

}  // namespace

RigMerge merge_rig(const std::vector<RigMember>& members, const std::vector<StampedPose>& odometry,
                   const RigOptions& options) {
  return RigMerger(members, odometry, options).run();
}

}  // namespace mapweave::rig
