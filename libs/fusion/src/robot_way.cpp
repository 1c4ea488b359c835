#include <mapweave/fusion/robot_way.h>

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

double turn_rad(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) { return a.angularDistance(b); }

struct Voice {
  std::size_t camera;
  Pose3 pose;
  double weight;
};

Pose3 mean(const std::vector<Voice>& voices) {
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  double sum = 0.0;
  for (const Voice& voice : voices) {
    const Eigen::Vector4d turn = voice.pose.q.coeffs();
    t += voice.weight * voice.pose.t, sum += voice.weight;
    q += voice.weight * (turn.dot(voices.front().pose.q.coeffs()) < 0.0 ? -turn : turn);
  }
  return {t / sum, Eigen::Quaterniond(q.normalized())};
}

// Who is believed, stamp by stamp.
class Policy {
 public:
  Policy(const std::vector<StampedPose>& odometry, const RobotWayOptions& options) : odometry_(odometry), options_(options) {}

  std::vector<Voice> speak(Stamp stamp, const std::vector<Voice>& voices) {
    std::vector<Voice> chosen = voices;
    double widest = 0.0;
    for (const Voice& a : voices)
      for (const Voice& b : voices) widest = std::max(widest, apart(a.pose, b.pose));
    if (widest > 1.0) chosen = most(stamp, voices);
    const StampedPose now{stamp, mean(chosen)};
    constexpr double kClose = 0.5;
    if (widest < kClose || !agreed_) agreed_ = now;
    before_last_ = last_, last_ = now;
    return chosen;
  }

 private:
  double apart(const Pose3& a, const Pose3& b) const {
    return std::max((a.t - b.t).norm() / options_.doubt_m, turn_rad(a.q, b.q) / options_.doubt_rad);
  }

  // The most that agree with one of them; where that is no majority, those around the one that is nearest to where the robot should be.
  std::vector<Voice> most(Stamp stamp, const std::vector<Voice>& voices) const {
    std::vector<std::vector<Voice>> around(voices.size());
    for (std::size_t i = 0; i < voices.size(); ++i)
      for (const Voice& other : voices)
        if (apart(voices[i].pose, other.pose) <= 1.0) around[i].push_back(other);
    std::size_t best = 0;
    for (std::size_t i = 1; i < voices.size(); ++i)
      if (around[i].size() > around[best].size()) best = i;
    if (2 * around[best].size() > voices.size()) return around[best];
    if (const auto there = expected(stamp))
      for (std::size_t i = 0; i < voices.size(); ++i)
        if (apart(voices[i].pose, *there) < apart(voices[best].pose, *there)) best = i;
    return around[best];
  }

  std::optional<Pose3> expected(Stamp stamp) const {
    if (agreed_ && seconds_between(agreed_->stamp, stamp) < options_.odometry_s) {
      const auto then = pose_at(odometry_, agreed_->stamp, options_.longest_gap_s), now = pose_at(odometry_, stamp, options_.longest_gap_s);
      if (then && now) return compose(agreed_->map_from_robot, between(*then, *now));
    }
    if (!last_) return std::nullopt;
    if (!before_last_) return last_->map_from_robot;
    const double span = seconds_between(before_last_->stamp, last_->stamp), further = seconds_between(last_->stamp, stamp);
    if (further > options_.longest_gap_s) return last_->map_from_robot;
    return interpolated(before_last_->map_from_robot, last_->map_from_robot, 1.0 + further / span);
  }

  const std::vector<StampedPose>& odometry_;
  const RobotWayOptions& options_;
  std::optional<StampedPose> agreed_, last_, before_last_;
};

// Seconds to the nearest stamp at which the camera is silent.
std::vector<double> from_silence(const std::vector<Stamp>& stamps, const std::vector<char>& speaks) {
  std::vector<double> result(stamps.size(), 1e9);
  const auto sweep = [&](std::size_t i, std::optional<Stamp>& silent) {
    if (speaks[i] == 0) silent = stamps[i];
    if (silent) result[i] = std::min(result[i], std::abs(seconds_between(*silent, stamps[i])));
  };
  std::optional<Stamp> before, after;
  for (std::size_t i = 0; i < stamps.size(); ++i) sweep(i, before);
  for (std::size_t i = stamps.size(); i-- > 0;) sweep(i, after);
  return result;
}

}  // namespace

std::vector<StampedPose> robot_way(const std::vector<SeenWay>& cameras, const std::vector<StampedPose>& odometry,
                                   const RobotWayOptions& options) {
  if (cameras.size() == 1) return cameras.front().frames;
  std::vector<Stamp> stamps;
  for (const SeenWay& camera : cameras)
    for (const StampedPose& frame : camera.frames) stamps.push_back(frame.stamp);
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  if (stamps.empty()) return {};

  std::vector<std::vector<Voice>> voices(stamps.size());
  std::vector<std::vector<char>> speaks(cameras.size(), std::vector<char>(stamps.size(), 0));
  Policy policy(odometry, options);
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    for (std::size_t c = 0; c < cameras.size(); ++c)
      if (const auto pose = pose_at(cameras[c].frames, stamps[i], options.longest_gap_s))
        voices[i].push_back({c, *pose, cameras[c].weight});
    for (const Voice& voice : policy.speak(stamps[i], voices[i])) speaks[voice.camera][i] = 1;
  }
  std::vector<std::vector<double>> silence_s;
  for (const auto& of_camera : speaks) silence_s.push_back(from_silence(stamps, of_camera));
  std::vector<StampedPose> way;
  Pose3 handed_over;  // to where those spoke who spoke before
  Stamp since = stamps.front();
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    std::vector<Voice> now, then;
    bool goes_on = i == 0;
    for (Voice voice : voices[i]) {
      if (speaks[voice.camera][i] == 0) continue;
      goes_on = goes_on || speaks[voice.camera][i - 1] != 0;
      voice.weight *= std::min(1.0, silence_s[voice.camera][i] / options.hand_over_s);
      now.push_back(voice);
    }
    for (std::size_t v = 0; !goes_on && v < voices[i - 1].size(); ++v)
      if (speaks[voices[i - 1][v].camera][i] != 0) then.push_back(voices[i - 1][v]);
    if (!then.empty()) handed_over = compose(way.back().map_from_robot, inverse(mean(then))), since = stamps[i - 1];
    const Pose3 pose = mean(now);
    const double share = std::min(1.0, seconds_between(since, stamps[i]) / options.hand_over_s);
    way.push_back({stamps[i], interpolated(compose(handed_over, pose), pose, share)});
  }
  return way;
}

std::vector<StampedPose> carried_along(const std::vector<StampedPose>& frames, const std::vector<MovedKeyframe>& keyframes) {
  std::vector<StampedPose> result;
  if (keyframes.empty()) return result;
  const auto carried = [](const Pose3& pose, const MovedKeyframe& keyframe) {
    Pose3 step = between(keyframe.before, pose);
    step.t *= keyframe.scale;
    return compose(keyframe.after, step);
  };
  for (const StampedPose& frame : frames) {
    const auto later = std::upper_bound(keyframes.begin(), keyframes.end(), frame.stamp,
                                        [](Stamp stamp, const MovedKeyframe& keyframe) { return stamp < keyframe.stamp; });
    const MovedKeyframe& before = *(later == keyframes.begin() ? later : later - 1);
    const MovedKeyframe& after = later == keyframes.end() ? before : *later;
    const double span_s = seconds_between(before.stamp, after.stamp);
    const double share = span_s > 0.0 ? seconds_between(before.stamp, frame.stamp) / span_s : 0.0;
    result.push_back({frame.stamp, interpolated(carried(frame.map_from_robot, before), carried(frame.map_from_robot, after), share)});
  }
  return result;
}

}  // namespace mapweave::fusion
