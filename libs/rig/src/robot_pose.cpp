#include "trajectory_policy.h"

#include <mapweave/rig/robot_pose.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace mapweave::rig {
namespace {

// Adds the newest; those between it and the last but one are dropped where they are denser than that.
void add_thinly(std::vector<StampedPose>& poses, const StampedPose& pose, double least_s) {
  if (poses.size() > 1 && seconds_between(poses[poses.size() - 2].stamp, pose.stamp) < least_s) poses.pop_back();
  poses.push_back(pose);
}

// Drops those that are older than this before the newest, once they are the most of them.
void forget(std::vector<StampedPose>& poses, double seconds) {
  const auto recent = std::partition_point(poses.begin(), poses.end(), [&](const StampedPose& pose) {
    return seconds_between(pose.stamp, poses.back().stamp) > seconds;
  });
  if (2 * (recent - poses.begin()) > poses.end() - poses.begin()) poses.erase(poses.begin(), recent);
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
  std::optional<Stamp> silent;  // when it was not believed last
};

// The answers so far, up to a stamp.
struct PoseFollower {
  explicit PoseFollower(const RobotTrajectoryOptions& options) : policy(options) {}

  TrajectoryPolicy policy;
  std::map<SensorId, Camera> cameras;
  std::optional<StampedPose> last;
  std::map<SensorId, Pose3> votes;  // at `last`, believed or not
  std::set<SensorId> believed;      // at `last`
  Pose3 handed_over;                // from the pose by the cameras that are believed now to that by those before
  std::optional<Stamp> since;

  // To a later stamp at which one of them has a pose.
  void go_on(Stamp stamp, const OdometryAt& odometry, const RobotTrajectoryOptions& options) {
    std::vector<SensorId> names;
    std::vector<CameraVote> received;
    for (const auto& [name, camera] : cameras)
      if (const auto pose = pose_of(camera, stamp, odometry, options)) {
        received.push_back({names.size(), *pose, camera.weight});
        names.push_back(name);
      }
    Chosen chosen{policy.believed(stamp, received, odometry), names, {}};
    for (CameraVote& vote : chosen.votes) {
      chosen.cameras.insert(names[vote.camera]);
      if (const auto& silent = cameras[names[vote.camera]].silent)
        vote.weight *= std::min(1.0, seconds_between(*silent, stamp) / options.hand_over_s);
    }
    const Pose3 pose = mean(chosen.votes);
    hand_over(stamp, pose, chosen, odometry, options);
    const double share = since ? std::min(1.0, seconds_between(*since, stamp) / options.hand_over_s) : 1.0;
    last = StampedPose{stamp, interpolated(compose(handed_over, pose), pose, share)};
    votes.clear();
    for (const CameraVote& vote : received) votes.emplace(names[vote.camera], vote.pose);
    believed = std::move(chosen.cameras);
    for (auto camera = cameras.begin(); camera != cameras.end();) {
      if (believed.count(camera->first) == 0) camera->second.silent = stamp;
      const double age_s = seconds_between(camera->second.frames.back().stamp, stamp);
      camera = age_s > options.longest_gap_s ? cameras.erase(camera) : std::next(camera);
    }
  }

 private:
  // What is believed at a stamp.
  struct Chosen {
    std::vector<CameraVote> votes;
    const std::vector<SensorId>& names;  // by number of camera
    std::set<SensorId> cameras;
  };
  static std::optional<Pose3> pose_of(const Camera& camera, Stamp stamp, const OdometryAt& odometry,
                                      const RobotTrajectoryOptions& options) {
    const StampedPose& newest = camera.frames.back();
    if (newest.stamp == stamp) return newest.map_from_robot;
    if (seconds_between(newest.stamp, stamp) > options.longest_gap_s) return std::nullopt;
    const auto then = odometry(newest.stamp), now = odometry(stamp);
    if (then && now) return compose(newest.map_from_robot, between(*then, *now));
    return pose_at_or_after(camera.frames, stamp, options.longest_gap_s);
  }

  // Where a camera has gone, or none was believed for a while: from the last answer slowly to the new pose.
  void hand_over(Stamp stamp, const Pose3& pose, const Chosen& chosen, const OdometryAt& odometry,
                 const RobotTrajectoryOptions& options) {
    if (!last) return;
    if (seconds_between(last->stamp, stamp) > options.longest_gap_s) {
      const auto then = odometry(last->stamp), now = odometry(stamp);
      since.reset();
      if (!then || !now || seconds_between(last->stamp, stamp) > options.odometry_s) return;
      handed_over = compose(compose(last->map_from_robot, between(*then, *now)), inverse(pose));
      since = stamp;
      return;
    }
    if (std::includes(chosen.cameras.begin(), chosen.cameras.end(), believed.begin(), believed.end())) return;
    std::vector<CameraVote> before;
    for (const CameraVote& vote : chosen.votes)
      if (const auto known = votes.find(chosen.names[vote.camera]); known != votes.end())
        before.push_back({vote.camera, known->second, vote.weight});
    handed_over = compose(last->map_from_robot, inverse(before.empty() ? pose : mean(before)));
    since = before.empty() ? stamp : last->stamp;
  }
};

}  // namespace

struct RobotPose::State {
  explicit State(const RobotTrajectoryOptions& with) : options(with), followed(with) {}

  RobotTrajectoryOptions options;
  std::vector<StampedPose> odometry;
  PoseFollower followed;        // up to before `newest`
  std::optional<Stamp> newest;  // of cameras

  OdometryAt odometry_at() const {
    return [this](Stamp stamp) { return pose_at_or_after(odometry, stamp, options.longest_gap_s); };
  }
};

RobotPose::RobotPose(const RobotTrajectoryOptions& options) : state_(std::make_unique<State>(options)) {}
RobotPose::~RobotPose() = default;
RobotPose::RobotPose(RobotPose&&) noexcept = default;
RobotPose& RobotPose::operator=(RobotPose&&) noexcept = default;

void RobotPose::add(SensorId camera, const StampedPose& pose, double weight) {
  State& state = *state_;
  if (!(weight > 0.0) || !std::isfinite(weight) || !is_finite(pose.map_from_robot)) return;
  if (state.newest && seconds_between(pose.stamp, *state.newest) > state.options.longest_gap_s)
    return;  // it is too old to count
  if (state.newest && *state.newest < pose.stamp)
    state.followed.go_on(*state.newest, state.odometry_at(), state.options);
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
  PoseFollower followed = state.followed;
  followed.go_on(*state.newest, state.odometry_at(), state.options);
  RobotPoseAnswer answer{*followed.last, static_cast<int>(followed.believed.size())};
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

}  // namespace mapweave::rig
