#include <mapweave/core/format.h>
#include <mapweave/rig/aligned_trajectories.h>
#include <mapweave/rig/fused_pose.h>
#include <mapweave/rig/scale.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>

namespace mapweave::rig {
namespace {

constexpr double kSensorSigma_m = 0.02;          // of a pose in its sensor's own map
constexpr double kWheels_per_m = 0.05;           // what wheels add
constexpr double kLongestInterpolation_s = 1.0;  // between two readings of the wheels

// By priority: as options say, with depth before without, then as they come.
void sort_by_priority(std::vector<SpokenPoses>& sensors, FirstSource first) {
  const auto rank = [&](const SpokenPoses& one) {
    if (one.sensor.is_laser) return first == FirstSource::laser ? 0 : 3;
    return one.sensor.is_metric ? 1 : 2;
  };
  std::stable_sort(sensors.begin(), sensors.end(),
                   [&](const SpokenPoses& a, const SpokenPoses& b) { return rank(a) < rank(b); });
}

// The wheels until now: no later reading helps.
class WheelsSoFar {
 public:
  explicit WheelsSoFar(const std::vector<StampedPose>& all) : all_(&all) {}
  void advance() { ++count_; }
  const StampedPose& newest() const { return (*all_)[count_ - 1]; }
  // Between two readings; after the newest one for a moment as it moved before.
  std::optional<Pose3> at(Stamp stamp) const {
    const auto begin = all_->begin(), end = begin + static_cast<std::ptrdiff_t>(count_);
    if (begin == end) return std::nullopt;
    auto after = std::lower_bound(begin, end, stamp,
                                  [](const StampedPose& reading, Stamp sought) { return reading.stamp < sought; });
    if (after != end && after->stamp == stamp) return after->map_from_robot;
    if (after == begin) return std::nullopt;
    if (after == end && (end - begin < 2 || seconds_between((end - 1)->stamp, stamp) > kLongestInterpolation_s))
      return seconds_between((end - 1)->stamp, stamp) > kLongestInterpolation_s
                 ? std::nullopt
                 : std::optional<Pose3>((end - 1)->map_from_robot);
    if (after == end) --after;
    const StampedPose& before = *(after - 1);
    const double span_s = seconds_between(before.stamp, after->stamp);
    if (span_s > kLongestInterpolation_s) return before.map_from_robot;
    return interpolated(before.map_from_robot, after->map_from_robot, seconds_between(before.stamp, stamp) / span_s);
  }

 private:
  const std::vector<StampedPose>* all_;
  std::size_t count_ = 0;
};

// Up to when a sensor that speaks regularly is waited for.
class Patience {
 public:
  explicit Patience(double silence_s) : silence_s_(silence_s) {}
  void add_interval(double seconds) {
    intervals_s_.push_back(seconds);
    if (intervals_s_.size() > kIntervals) intervals_s_.pop_front();
  }
  double seconds() const {
    if (intervals_s_.empty()) return std::max(silence_s_, kFirst_s);
    return std::max(silence_s_, kMissed * *std::min_element(intervals_s_.begin(), intervals_s_.end()));
  }

 private:
  static constexpr std::size_t kIntervals = 5;  // the latest: a sensor may slow down
  // A sensor is silent after two poses that did not come, and half an interval; before any interval is known, after so
  // long.
  static constexpr double kMissed = 2.5, kFirst_s = 5.0;
  double silence_s_;
  std::deque<double> intervals_s_;
};

// One sensor with its map.
struct SensorState {
  explicit SensorState(double silence_s) : patience(silence_s) {}
  std::optional<int> session;
  std::map<int, Pose3> output_from_map;       // by session: a sensor may come back to a map
  std::optional<StampedPose> previous, last;  // in its map, in metres
  Patience patience;
  std::vector<CommonPose> scale_pairs;  // of a single camera, until its scale is known: by wheels, in its map
  double scale_path_m = 0.0;
  std::map<int, double> scales;  // by session

  bool is_alive(Stamp now) const { return last && seconds_between(last->stamp, now) <= patience.seconds(); }
  void begin(int number) {
    session = number;
    previous = last = std::nullopt;
    scale_pairs.clear();
    scale_path_m = 0.0;
  }
  bool is_placed() const { return output_from_map.count(*session) > 0; }
  void place(const Pose3& pose) { output_from_map[*session] = pose; }
  void add(const StampedPose& pose) {
    if (last) patience.add_interval(seconds_between(last->stamp, pose.stamp));
    previous = last;
    last = pose;
  }
};

class PoseFuser {
 public:
  PoseFuser(const std::vector<SpokenPoses>& sensors, const std::vector<StampedPose>& odometry,
            const FusedPoseOptions& options)
      : sensors_(sensors),
        odometry_(odometry),
        options_(options),
        wheels_(odometry),
        states_(sensors.size(), SensorState(options.silence_s)) {}

  void run() {
    std::vector<std::size_t> next(sensors_.size(), 0);
    for (std::size_t next_reading = 0;;) {
      // The earliest of all; of one stamp the wheels, then sensors by priority.
      std::optional<Stamp> earliest;
      std::size_t who = sensors_.size();
      if (next_reading < odometry_.size()) earliest = odometry_[next_reading].stamp;
      for (std::size_t i = 0; i < sensors_.size(); ++i)
        if (next[i] < sensors_[i].poses.size() && (!earliest || sensors_[i].poses[next[i]].stamp < *earliest)) {
          earliest = sensors_[i].poses[next[i]].stamp;
          who = i;
        }
      if (!earliest) return;
      if (who < sensors_.size()) {
        take(who, sensors_[who].poses[next[who]++]);
      } else {
        ++next_reading;
        wheels_.advance();
        take_wheels();
      }
    }
  }

  std::vector<FusedPose> take_poses() { return std::move(poses_); }
  std::optional<double> scale() const { return scale_; }

 private:
  struct Spoken {
    StampedPose pose;
    double path_m;  // by wheels since then
    Pose3 carried;  // by wheels until now
  };

  std::size_t leader_at(Stamp now) const {
    std::size_t sensor = 0;
    while (sensor < states_.size() && !states_[sensor].is_alive(now)) ++sensor;
    return sensor;
  }

  // Where the pose of the sensor that spoke last is by now: by wheels, else as the robot moved before.
  std::optional<Pose3> expected(Stamp now) const {
    if (!spoken_) return std::nullopt;
    const StampedPose& last = spoken_->pose;
    const auto then = wheels_.at(last.stamp), there = wheels_.at(now);
    if (then && there) return compose(last.map_from_robot, between(*then, *there));
    if (!before_) return std::nullopt;
    const double span_s = seconds_between(before_->stamp, last.stamp), further_s = seconds_between(last.stamp, now);
    if (!(span_s > 0.0) || span_s > options_.silence_s || further_s > options_.silence_s) return std::nullopt;
    return interpolated(before_->map_from_robot, last.map_from_robot, 1.0 + further_s / span_s);
  }

  void take_wheels() {
    const Stamp now = wheels_.newest().stamp;
    if (!spoken_ || !(spoken_->pose.stamp < now)) return;
    const auto pose = expected(now);
    if (!pose) return;
    spoken_->path_m += (pose->t - spoken_->carried.t).norm();
    spoken_->carried = *pose;
    FusedPose fused{now, *pose, sensors_.size(), leader_at(now)};
    fused.deviation_m = kSensorSigma_m + kWheels_per_m * spoken_->path_m;
    fused.alone_s = seconds_between(spoken_->pose.stamp, now);
    put(fused);
  }

  void take(std::size_t sensor, const SensorPose& said) {
    if (!is_finite(said.map_from_robot)) return;
    SensorState& state = states_[sensor];
    const bool is_new_map = !state.output_from_map.empty() && state.output_from_map.count(said.session) == 0;
    if (state.session != said.session) state.begin(said.session);
    const auto pose = in_metres(sensor, said);
    if (!pose) return;
    state.add({said.stamp, *pose});
    if (!state.is_placed()) place(state);
    if (leader_at(said.stamp) != sensor) {
      follow_leader(state);
    } else {
      speak(sensor, is_new_map);
    }
  }

  // A single camera gets its scale from the wheels. Until it is known the wheels speak, from where the camera began.
  std::optional<Pose3> in_metres(std::size_t sensor, const SensorPose& said) {
    const PoseSensor& known = sensors_[sensor].sensor;
    if (known.is_metric) return said.map_from_robot;
    SensorState& state = states_[sensor];
    if (odometry_.empty()) return sensors_.size() == 1 ? std::optional(said.map_from_robot) : std::nullopt;
    if (state.scales.count(said.session) == 0) learn_scale(state, known, said);
    if (const auto found = state.scales.find(said.session); found != state.scales.end())
      return rescaled(said.map_from_robot, known.robot_from_sensor, found->second);
    if (!spoken_) spoken_ = Spoken{{said.stamp, said.map_from_robot}, 0.0, said.map_from_robot};
    return std::nullopt;
  }

  void learn_scale(SensorState& state, const PoseSensor& known, const SensorPose& said) {
    constexpr double kStep_m = 0.1;  // between two pairs: nearer ones tell more of noise than of scale
    const auto by_wheels = wheels_.at(said.stamp);
    if (!by_wheels) return;
    const CommonPose pair{compose(*by_wheels, known.robot_from_sensor),
                          compose(said.map_from_robot, known.robot_from_sensor)};
    if (!state.scale_pairs.empty()) {
      const double step_m = (pair.in_a.t - state.scale_pairs.back().in_a.t).norm();
      if (step_m < kStep_m) return;
      state.scale_path_m += step_m;
    }
    state.scale_pairs.push_back(pair);
    if (state.scale_path_m < options_.scale_path_m) return;
    if (const auto scale = scale_of_trajectories(state.scale_pairs)) {
      state.scales[said.session] = *scale;
      scale_ = scale;
    }
    state.scale_pairs.clear();
    state.scale_path_m = 0.0;
  }

  // A new map begins where the robot is now, as far as that is known.
  void place(SensorState& state) {
    if (!spoken_) return state.place({});  // its frame is that of all
    const Pose3 here = expected(state.last->stamp).value_or(spoken_->pose.map_from_robot);
    state.place(compose(here, inverse(state.last->map_from_robot)));
  }

  // So that nothing jumps where it has to take over, it agrees with what was said last.
  void follow_leader(SensorState& state) {
    if (!spoken_ || !state.previous) return;
    const Stamp then = spoken_->pose.stamp;
    if (then < state.previous->stamp || state.last->stamp < then) return;
    const double span_s = seconds_between(state.previous->stamp, state.last->stamp);
    if (span_s > state.patience.seconds()) return;
    const Pose3 there = interpolated(state.previous->map_from_robot, state.last->map_from_robot,
                                     seconds_between(state.previous->stamp, then) / span_s);
    state.place(compose(spoken_->pose.map_from_robot, inverse(there)));
  }

  void speak(std::size_t sensor, bool is_new_map) {
    const SensorState& state = states_[sensor];
    const StampedPose pose{state.last->stamp,
                           compose(state.output_from_map.at(*state.session), state.last->map_from_robot)};
    FusedPose fused{pose.stamp, pose.map_from_robot, sensor, sensor};
    fused.deviation_m = kSensorSigma_m;
    if (spoken_) fused.alone_s = seconds_between(spoken_->pose.stamp, pose.stamp);
    if (const auto foreseen = expected(pose.stamp)) {
      fused.jump_m = (foreseen->t - pose.map_from_robot.t).norm();
      fused.jump_rad = foreseen->q.angularDistance(pose.map_from_robot.q);
    }
    if (is_new_map) fused.event = PoseEvent::new_map;
    if (spoken_) before_ = spoken_->pose;
    spoken_ = Spoken{pose, 0.0, pose.map_from_robot};
    put(fused);
  }

  // Each stamp stands once in a file of microseconds; sensors come after wheels and are worth more.
  void put(const FusedPose& pose) {
    const auto microsecond = [](Stamp stamp) { return (stamp.ns + (stamp.ns < 0 ? -500 : 500)) / 1000; };
    if (!poses_.empty() && microsecond(poses_.back().stamp) == microsecond(pose.stamp)) {
      if (pose.source <= poses_.back().source) poses_.back() = pose;
    } else {
      poses_.push_back(pose);
    }
  }

  const std::vector<SpokenPoses>& sensors_;
  const std::vector<StampedPose>& odometry_;
  FusedPoseOptions options_;
  WheelsSoFar wheels_;
  std::vector<SensorState> states_;
  std::optional<Spoken> spoken_;       // by the sensor that spoke last
  std::optional<StampedPose> before_;  // by a sensor, before that
  std::vector<FusedPose> poses_;
  std::optional<double> scale_;
};

// Who was in charge, and what happened.
void summarise(FusedTrajectory& trajectory, const FusedPoseOptions& options) {
  FusedPoseReport& report = trajectory.report;
  const std::size_t wheels = report.sources.size() - 1;
  const FusedPose* before = nullptr;
  for (FusedPose& pose : trajectory.poses) {
    ++report.sources[pose.source].poses;
    const bool is_new_map = pose.event == PoseEvent::new_map,
               is_jump = pose.jump_m > options.jump_m || pose.jump_rad > options.jump_rad;
    if (before == nullptr) {
      pose.event = PoseEvent::begins;
    } else {
      const double since_s = seconds_between(before->stamp, pose.stamp);
      report.sources[pose.leader].led_s += since_s;
      report.longest_gap_s = std::max(report.longest_gap_s, since_s);
      if (pose.leader == wheels || before->leader == wheels)
        report.longest_on_wheels_s = std::max(report.longest_on_wheels_s, pose.alone_s);
      const bool fails_over = pose.leader > before->leader, returns = pose.leader < before->leader;
      report.failovers += fails_over;
      report.returns += returns;
      if (!is_new_map)
        pose.event = fails_over ? PoseEvent::fails_over
                     : returns  ? PoseEvent::returns
                     : is_jump  ? PoseEvent::jump
                                : PoseEvent::none;
      report.jumps += is_jump;
      report.largest_jump_m = std::max(report.largest_jump_m, pose.jump_m);
      report.largest_jump_rad = std::max(report.largest_jump_rad, pose.jump_rad);
    }
    before = &pose;
  }
}

}  // namespace

const char* to_text(PoseEvent event) {
  switch (event) {
    case PoseEvent::begins: return "begins";
    case PoseEvent::fails_over: return "fails_over";
    case PoseEvent::returns: return "returns";
    case PoseEvent::new_map: return "new_map";
    case PoseEvent::jump: return "jump";
    case PoseEvent::none: break;
  }
  return "";
}

std::vector<StampedPose> FusedTrajectory::stamped() const {
  std::vector<StampedPose> result;
  result.reserve(poses.size());
  for (const FusedPose& pose : poses) result.push_back({pose.stamp, pose.map_from_robot});
  return result;
}

std::string FusedTrajectory::sources_csv() const {
  std::string text = "stamp_s,source,leader,deviation_m,alone_s,event,jump_m,jump_rad\n";
  for (const FusedPose& pose : poses) {
    const std::int64_t stamp_us = (pose.stamp.ns + (pose.stamp.ns < 0 ? -500 : 500)) / 1000;
    text += format("%s%lld.%06lld,%s,%s,%.3f,%.3f,%s,%.3f,%.4f\n", stamp_us < 0 ? "-" : "",
                   static_cast<long long>(std::abs(stamp_us) / 1000000),
                   static_cast<long long>(std::abs(stamp_us) % 1000000), report.sources[pose.source].name.c_str(),
                   report.sources[pose.leader].name.c_str(), pose.deviation_m, pose.alone_s, to_text(pose.event),
                   pose.jump_m, pose.jump_rad);
  }
  return text;
}

FusedTrajectory fused_poses(std::vector<SpokenPoses> sensors, const std::vector<StampedPose>& odometry,
                            const FusedPoseOptions& options) {
  sort_by_priority(sensors, options.first);
  FusedTrajectory result;
  for (const SpokenPoses& one : sensors) result.report.sources.push_back({one.sensor.name, 0, 0.0});
  result.report.sources.push_back({"wheels", 0, 0.0});
  PoseFuser fuser(sensors, odometry, options);
  fuser.run();
  result.poses = fuser.take_poses();
  result.report.scale = fuser.scale();
  result.report.is_metric = !(sensors.size() == 1 && !sensors.front().sensor.is_metric && odometry.empty());
  summarise(result, options);
  return result;
}

}  // namespace mapweave::rig
