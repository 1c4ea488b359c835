#include "trajectory_policy.h"

#include <mapweave/rig/scale.h>

#include <algorithm>
#include <cmath>

namespace mapweave::rig {
namespace {

// Seconds to the nearest stamp at which the camera is not believed.
std::vector<double> from_silence(const std::vector<Stamp>& stamps, const std::vector<char>& believed) {
  std::vector<double> result(stamps.size(), 1e9);
  const auto sweep = [&](std::size_t i, std::optional<Stamp>& silent) {
    if (believed[i] == 0) silent = stamps[i];
    if (silent) result[i] = std::min(result[i], std::abs(seconds_between(*silent, stamps[i])));
  };
  std::optional<Stamp> before, after;
  for (std::size_t i = 0; i < stamps.size(); ++i) sweep(i, before);
  for (std::size_t i = stamps.size(); i-- > 0;) sweep(i, after);
  return result;
}

}  // namespace

std::vector<StampedPose> robot_trajectory(const std::vector<CameraTrajectory>& cameras,
                                          const std::vector<StampedPose>& odometry,
                                          const RobotTrajectoryOptions& options) {
  if (cameras.size() == 1) return cameras.front().frames;
  std::vector<Stamp> stamps;
  for (const CameraTrajectory& camera : cameras)
    for (const StampedPose& frame : camera.frames) stamps.push_back(frame.stamp);
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  if (stamps.empty()) return {};

  std::vector<std::vector<CameraVote>> votes(stamps.size());
  std::vector<std::vector<char>> believed(cameras.size(), std::vector<char>(stamps.size(), 0));
  TrajectoryPolicy policy(options);
  const OdometryAt odometry_at = [&](Stamp stamp) { return pose_at(odometry, stamp, options.longest_gap_s); };
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    for (std::size_t c = 0; c < cameras.size(); ++c)
      if (const auto pose = pose_at(cameras[c].frames, stamps[i], options.longest_gap_s))
        votes[i].push_back({c, *pose, cameras[c].weight});
    for (const CameraVote& vote : policy.believed(stamps[i], votes[i], odometry_at)) believed[vote.camera][i] = 1;
  }
  std::vector<std::vector<double>> silence_s;
  for (const auto& of_camera : believed) silence_s.push_back(from_silence(stamps, of_camera));
  std::vector<StampedPose> trajectory;
  Pose3 handed_over;  // from the pose by the cameras that are believed now to that by those before
  Stamp since = stamps.front();
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    std::vector<CameraVote> now, then;
    bool goes_on = i == 0;
    for (CameraVote vote : votes[i]) {
      if (believed[vote.camera][i] == 0) continue;
      goes_on = goes_on || believed[vote.camera][i - 1] != 0;
      vote.weight *= std::min(1.0, silence_s[vote.camera][i] / options.hand_over_s);
      now.push_back(vote);
    }
    for (std::size_t v = 0; !goes_on && v < votes[i - 1].size(); ++v)
      if (believed[votes[i - 1][v].camera][i] != 0) then.push_back(votes[i - 1][v]);
    if (!then.empty()) {
      handed_over = compose(trajectory.back().map_from_robot, inverse(mean(then)));
      since = stamps[i - 1];
    }
    const Pose3 pose = mean(now);
    const double share = std::min(1.0, seconds_between(since, stamps[i]) / options.hand_over_s);
    trajectory.push_back({stamps[i], interpolated(compose(handed_over, pose), pose, share)});
  }
  return trajectory;
}

std::vector<StampedPose> moved_with_keyframes(const std::vector<StampedPose>& frames,
                                              const std::vector<MovedKeyframe>& keyframes) {
  std::vector<StampedPose> result;
  if (keyframes.empty()) return result;
  const auto moved = [](const Pose3& pose, const MovedKeyframe& keyframe) {
    return compose(keyframe.after,
                   rescaled(between(keyframe.before, pose), keyframe.robot_from_camera, keyframe.scale));
  };
  for (const StampedPose& frame : frames) {
    const auto later =
        std::upper_bound(keyframes.begin(), keyframes.end(), frame.stamp,
                         [](Stamp stamp, const MovedKeyframe& keyframe) { return stamp < keyframe.stamp; });
    const MovedKeyframe& before = *(later == keyframes.begin() ? later : later - 1);
    const MovedKeyframe& after = later == keyframes.end() ? before : *later;
    const double span_s = seconds_between(before.stamp, after.stamp);
    const double share = span_s > 0.0 ? seconds_between(before.stamp, frame.stamp) / span_s : 0.0;
    result.push_back(
        {frame.stamp, interpolated(moved(frame.map_from_robot, before), moved(frame.map_from_robot, after), share)});
  }
  return result;
}

}  // namespace mapweave::rig
