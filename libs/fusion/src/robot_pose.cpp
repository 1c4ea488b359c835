#include "way_policy.h"

#include <mapweave/fusion/robot_pose.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace mapweave::fusion {
namespace {

// Adds the newest; those between it and the last but one are dropped where they are denser than that.
void add_thinly(std::vector<StampedPose>& poses, const StampedPose& pose, double least_s) {
  if (poses.size() > 1 && seconds_between(poses[poses.size() - 2].stamp, pose.stamp) < least_s) poses.pop_back();
  poses.push_back(pose);
}

// Drops those that are older than this before the newest, once they are the most of them.
void forget(std::vector<StampedPose>& poses, double seconds) {
  const auto young = std::partition_point(
      poses.begin(), poses.end(), [&](const StampedPose& pose) { return seconds_between(pose.stamp, poses.back().stamp) > seconds; });
  if (2 * (young - poses.begin()) > poses.end() - poses.begin()) poses.erase(poses.begin(), young);
}

// As pose_at; up to `longest_gap_s` after the last as it moved over such a time before.
std::optional<Pose3> pose_at_or_after(const std::vector<StampedPose>& poses, Stamp stamp, double longest_gap_s) {
  if (poses.empty() || stamp <= poses.back().stamp) return pose_at(poses, stamp, longest_gap_s);
  const StampedPose& last = poses.back();
  const double further_s = seconds_between(last.stamp, stamp);
  if (further_s > longest_gap_s) return std::nullopt;
  const auto first = std::find_if(poses.rbegin(), poses.rend(), [&](const StampedPose& pose) {
                       return seconds_between(pose.stamp, last.stamp) > longest_gap_s;
                     }).base();
  const double span_s = seconds_between(first->stamp, last.stamp);
  if (span_s <= 0.0) return last.map_from_robot;
  return interpolated(first->map_from_robot, last.map_from_robot, 1.0 + further_s / span_s);
}

struct Camera {
  std::vector<StampedPose> frames;  // the newest few
  double weight = 1.0;
  std::optional<Stamp> silent;  // when it was so last
};

// What was answered so far, up to a stamp.
struct Followed {
  explicit Followed(const RobotWayOptions& options) : policy(options) {}

  WayPolicy policy;
  std::map<SensorId, Camera> cameras;
  std::optional<StampedPose> last;
  std::map<SensorId, Pose3> voices;  // at `last`, believed or not
  std::set<SensorId> speakers;       // at `last`
  Pose3 handed_over;                 // to where those spoke who spoke before
  std::optional<Stamp> since;

  // To a later stamp at which one of them has a pose.
  void go_on(Stamp stamp, const OdometryAt& odometry, const RobotWayOptions& options) {
    std::vector<SensorId> names;
    std::vector<Voice> heard;
    for (const auto& [name, camera] : cameras)
      if (const auto pose = pose_of(camera, stamp, odometry, options)) {
        heard.push_back({names.size(), *pose, camera.weight});
        names.push_back(name);
      }
    std::vector<Voice> believed = policy.speak(stamp, heard, odometry);
    std::set<SensorId> speaking;
    for (Voice& voice : believed) {
      speaking.insert(names[voice.camera]);
      if (const auto& silent = cameras[names[voice.camera]].silent)
        voice.weight *= std::min(1.0, seconds_between(*silent, stamp) / options.hand_over_s);
    }
    const Pose3 pose = mean(believed);
    hand_over(stamp, pose, believed, names, speaking, odometry, options);
    const double share = since ? std::min(1.0, seconds_between(*since, stamp) / options.hand_over_s) : 1.0;
    last = StampedPose{stamp, interpolated(compose(handed_over, pose), pose, share)};
    voices.clear();
    for (const Voice& voice : heard) voices.emplace(names[voice.camera], voice.pose);
    speakers = std::move(speaking);
    for (auto camera = cameras.begin(); camera != cameras.end();) {
      if (speakers.count(camera->first) == 0) camera->second.silent = stamp;
      const double age_s = seconds_between(camera->second.frames.back().stamp, stamp);
      camera = age_s > options.longest_gap_s ? cameras.erase(camera) : std::next(camera);
    }
  }

 private:
  static std::optional<Pose3> pose_of(const Camera& camera, Stamp stamp, const OdometryAt& odometry, const RobotWayOptions& options) {
    const StampedPose& newest = camera.frames.back();
    if (newest.stamp == stamp) return newest.map_from_robot;
    if (seconds_between(newest.stamp, stamp) > options.longest_gap_s) return std::nullopt;
    const auto then = odometry(newest.stamp), now = odometry(stamp);
    if (then && now) return compose(newest.map_from_robot, between(*then, *now));
    return pose_at_or_after(camera.frames, stamp, options.longest_gap_s);
  }

  // Where one has gone, or nobody spoke for a while: from where the robot was said to be, slowly to where it is.
  void hand_over(Stamp stamp, const Pose3& pose, const std::vector<Voice>& believed, const std::vector<SensorId>& names,
                 const std::set<SensorId>& speaking, const OdometryAt& odometry, const RobotWayOptions& options) {
    if (!last) return;
    if (seconds_between(last->stamp, stamp) > options.longest_gap_s) {
      const auto then = odometry(last->stamp), now = odometry(stamp);
      since.reset();
      if (!then || !now || seconds_between(last->stamp, stamp) > options.odometry_s) return;
      handed_over = compose(compose(last->map_from_robot, between(*then, *now)), inverse(pose)), since = stamp;
      return;
    }
    if (std::includes(speaking.begin(), speaking.end(), speakers.begin(), speakers.end())) return;
    std::vector<Voice> before;
    for (const Voice& voice : believed)
      if (const auto known = voices.find(names[voice.camera]); known != voices.end())
        before.push_back({voice.camera, known->second, voice.weight});
    if (before.empty())
      handed_over = compose(last->map_from_robot, inverse(pose)), since = stamp;
    else
      handed_over = compose(last->map_from_robot, inverse(mean(before))), since = last->stamp;
  }
};

}  // namespace

struct RobotPose::State {
  explicit State(const RobotWayOptions& with) : options(with), followed(with) {}

  RobotWayOptions options;
  std::vector<StampedPose> odometry;
  Followed followed;            // up to before `newest`
  std::optional<Stamp> newest;  // of cameras

  OdometryAt odometry_at() const {
    return [this](Stamp stamp) { return pose_at_or_after(odometry, stamp, options.longest_gap_s); };
  }
};

RobotPose::RobotPose(const RobotWayOptions& options) : state_(std::make_unique<State>(options)) {}
RobotPose::~RobotPose() = default;
RobotPose::RobotPose(RobotPose&&) noexcept = default;
RobotPose& RobotPose::operator=(RobotPose&&) noexcept = default;

void RobotPose::add(SensorId camera, const StampedPose& pose, double weight) {
  State& state = *state_;
  if (!(weight > 0.0) || !std::isfinite(weight) || !is_finite(pose.map_from_robot)) return;
  if (state.newest && seconds_between(pose.stamp, *state.newest) > state.options.longest_gap_s) return;  // it would not speak any more
  if (state.newest && *state.newest < pose.stamp) state.followed.go_on(*state.newest, state.odometry_at(), state.options);
  state.newest = state.newest ? std::max(*state.newest, pose.stamp) : pose.stamp;
  Camera& known = state.followed.cameras[camera];
  if (known.frames.empty() && state.followed.last) known.silent = state.followed.last->stamp;
  if (!known.frames.empty() && pose.stamp <= known.frames.back().stamp) return;
  constexpr double kFrames = 8.0;  // within the longest gap
  add_thinly(known.frames, pose, state.options.longest_gap_s / kFrames);
  forget(known.frames, state.options.longest_gap_s);
  known.weight = weight;
}

void RobotPose::add_odometry(const StampedPose& pose) {
  std::vector<StampedPose>& odometry = state_->odometry;
  if (!is_finite(pose.map_from_robot) || (!odometry.empty() && pose.stamp <= odometry.back().stamp)) return;
  constexpr double kPoses = 16.0;  // within the longest gap
  add_thinly(odometry, pose, state_->options.longest_gap_s / kPoses);
  forget(odometry, state_->options.odometry_s + state_->options.longest_gap_s);
}

std::optional<RobotPoseAnswer> RobotPose::now() const {
  const State& state = *state_;
  if (!state.newest) return std::nullopt;
  Followed followed = state.followed;
  followed.go_on(*state.newest, state.odometry_at(), state.options);
  RobotPoseAnswer answer{*followed.last, static_cast<int>(followed.speakers.size())};
  if (state.odometry.empty()) return answer;
  const StampedPose& newest = state.odometry.back();
  const double alone_s = seconds_between(*state.newest, newest.stamp);
  if (alone_s <= 0.0) return answer;
  if (alone_s > state.options.odometry_s) return std::nullopt;
  const auto then = state.odometry_at()(*state.newest);
  if (!then) return answer;
  answer.pose = {newest.stamp, compose(answer.pose.map_from_robot, between(*then, newest.map_from_robot))};
  if (alone_s > state.options.longest_gap_s) answer.cameras = 0;
  return answer;
}

std::size_t RobotPose::kept() const {
  std::size_t count = state_->odometry.size();
  for (const auto& [name, camera] : state_->followed.cameras) count += camera.frames.size();
  return count;
}

}  // namespace mapweave::fusion
