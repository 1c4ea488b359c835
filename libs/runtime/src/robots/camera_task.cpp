#include <mapweave/runtime/camera_task.h>

#include "results/sheet_collector.h"
#include "robot_log.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/laser/scan_input.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/runtime/metrics.h>
#include <mapweave/visual/visual_client.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <algorithm>
#include <deque>
#include <map>
#include <numeric>

namespace mapweave::runtime {
namespace {

// A camera with its client, which begins with the first frame.
class Camera {
 public:
  Camera(const ChosenCamera& chosen, const VisualOptions& options, std::uint64_t seed)
      : chosen_(chosen), packer_({chosen.label, chosen.kind->camera}), options_(options) {
    options_.client.seed = seed;
    report_.label = chosen.label;
    report_.kind = std::string(chosen.kind->name);
  }

  void add(const rawlog::Record& record) {
    const double before_s = thread_cpu_seconds();
    const auto frame = packer_(record);
    if (!frame) return;
    if (!client_) {
      client_.emplace(packer_.rig()->camera, packer_.rig()->baseline_m, options_.client,
                      options_.chosen_vocabulary.get());
      first_ = frame->stamp;
      live_.sensor = {sensor_name(report_.label), false, frame->shows_depth(), packer_.rig()->robot_from_camera};
    }
    if (frame->odometry_from_camera)
      odometry_.push_back(
          {frame->stamp, compose(*frame->odometry_from_camera, inverse(packer_.rig()->robot_from_camera))});
    const double packed_s = thread_cpu_seconds();
    const visual::Tracked tracked = client_->add(*frame);
    (tracked.keyframe ? keyframe_seconds_ : tracking_seconds_).push_back(thread_cpu_seconds() - packed_s);
    packing_seconds_ += packed_s - before_s;
    ++report_.frames;
    last_ = frame->stamp;
    note(tracked.state, frame->stamp);
    if (tracked.state == visual::TrackState::tracked) {
      const Pose3& robot_from_camera = live_.sensor.robot_from_sensor;
      live_.poses.push_back({frame->stamp, tracked.session,
                             compose(compose(robot_from_camera, tracked.map_from_camera), inverse(robot_from_camera))});
    }
    sheet_.add(*frame,
               tracked.state == visual::TrackState::tracked ? client_->seen() : std::vector<visual::SeenLandmark>{},
               seconds_between(first_, frame->stamp));
  }

  bool tracked_anything() const { return report_.tracked > 0; }
  const CameraReport& report() const { return report_; }
  const std::vector<StampedPose>& odometry() const { return odometry_; }  // of the robot, at its frames
  rig::SpokenPoses take_live() { return std::move(live_); }               // of the robot, as it came
  std::vector<std::string> notes() const { return client_ ? client_->notes() : std::vector<std::string>{}; }
  double seconds() const { return report_.frames == 0 ? 0.0 : seconds_between(first_, last_); }

  visual::ClientPlace place(RobotId robot) const {
    return {{robot, SensorId(sensor_name(report_.label))}, packer_.rig()->robot_from_camera};
  }
  visual::VisualClient* client() { return client_ ? &*client_ : nullptr; }  // null before its first frame
  CameraReport& report() { return report_; }
  std::vector<tiers::KeptMap>& kept() { return kept_; }

  // Once: its maps, one for each session that stayed apart; each begins where the robot stood then.
  CameraResult finish(RobotId robot, std::vector<CameraMap>& maps) {
    CameraResult result;
    client_->finish();
    const Pose3 robot_from_camera = packer_.rig()->robot_from_camera, camera_from_robot = inverse(robot_from_camera);
    const std::vector<int> sessions = client_->sessions();
    std::vector<Map> published = client_->maps(place(robot));
    std::sort(published.begin(), published.end(),
              [](const Map& a, const Map& b) { return a.nodes.front().first < b.nodes.front().first; });
    report_.forgotten = client_->forgotten();
    const auto forgotten =
        kept_.empty() ? std::vector<visual::PlacedForgotten>{} : client_->forgotten_keyframes(place(robot));
    for (Map& map : published) report_.kept += tiers::add_forgotten(map, kept_, forgotten);
    kept_.clear();
    std::vector<CameraMap> own(sessions.size());
    for (const visual::PlacedFrame& frame : client_->trajectory()) {
      CameraMap& part = own[static_cast<std::size_t>(std::lower_bound(sessions.begin(), sessions.end(), frame.session) -
                                                     sessions.begin())];
      if (part.trajectories.empty())
        part.trajectories.push_back({report_.label, {}, packer_.rig()->robot_from_optical});
      part.trajectories.front().frames.push_back(
          {frame.stamp, compose(compose(robot_from_camera, frame.map_from_camera), camera_from_robot)});
    }
    MAPWEAVE_EXPECT(published.size() == own.size(), "each session has published its map");
    for (std::size_t i = 0; i < own.size(); ++i) {
      own[i].map = std::move(published[i]);
      maps.push_back(std::move(own[i]));
    }
    report_.sessions = sessions.size();
    report_.keyframes = client_->keyframes().size();
    report_.landmarks = client_->landmarks().size();
    for (const visual::ClosedLoop& loop : client_->loops()) {
      report_.loops.push_back({seconds_between(first_, loop.found), seconds_between(first_, loop.applied)});
      report_.loops_on_shared += loop.on_shared.has_value();
    }
    report_.readout_s = client_->sensor().readout_s;
    report_.inverse_depth_offset = client_->sensor().inverse_depth_offset;
    const auto mean_ms = [](const std::vector<double>& seconds) {
      return seconds.empty()
                 ? 0.0
                 : 1e3 * std::accumulate(seconds.begin(), seconds.end(), 0.0) / static_cast<double>(seconds.size());
    };
    report_.tracking_mean_ms = mean_ms(tracking_seconds_);
    report_.keyframe_mean_ms = mean_ms(keyframe_seconds_);
    report_.packing_mean_ms = 1e3 * packing_seconds_ / static_cast<double>(report_.frames);
    std::sort(tracking_seconds_.begin(), tracking_seconds_.end());
    if (!tracking_seconds_.empty())
      report_.tracking_p99_ms = 1e3 * tracking_seconds_[(tracking_seconds_.size() - 1) * 99 / 100];
    result.report = report_;
    result.chosen = chosen_;
    result.notes = client_->notes();
    result.sheet = sheet_.take();
    client_.reset();
    return result;
  }

 private:
  void note(visual::TrackState state, Stamp stamp) {
    if (state == visual::TrackState::tracked) {
      ++report_.tracked;
      last_tracked_ = stamp;
    } else if (state == visual::TrackState::lost) {
      ++report_.lost;
      report_.longest_loss_s = std::max(report_.longest_loss_s, seconds_between(last_tracked_, stamp));
    }
  }

  ChosenCamera chosen_;
  visual::FramePacker packer_;
  VisualOptions options_;
  std::optional<visual::VisualClient> client_;
  CameraReport report_;
  std::vector<tiers::KeptMap> kept_;
  SheetCollector sheet_;
  std::vector<StampedPose> odometry_;
  rig::SpokenPoses live_;
  Stamp first_, last_, last_tracked_;
  std::vector<double> tracking_seconds_, keyframe_seconds_;
  double packing_seconds_ = 0.0;
};

// Cameras of one robot see one world.
std::vector<CameraMap> merged_rig(std::vector<CameraMap> parts, RobotId robot, const std::vector<StampedPose>& odometry,
                                  const rig::RigOptions& options, std::vector<std::string>& notes) {
  std::vector<rig::RigMember> members;
  std::map<std::string, Pose3> robot_from_optical;  // by label
  for (CameraMap& part : parts) {
    FrameTrajectory& trajectory = part.trajectories.front();
    robot_from_optical[trajectory.label] = trajectory.robot_from_optical;
    members.push_back({trajectory.label, std::move(part.map), std::move(trajectory.frames)});
  }
  rig::RigMerge rig = rig::merge_rig(members, odometry, options);
  notes = std::move(rig.notes);
  std::vector<CameraMap> result;
  for (rig::RigMap& merged : rig.maps) {
    CameraMap& map = result.emplace_back();
    map.map = std::move(merged.map);
    map.map.id = MapId(result.size() == 1 ? robot.str() : robot.str() + "." + std::to_string(result.size() - 1));
    for (std::size_t i = 0; i < merged.members.size(); ++i) {
      const std::string& label = members[merged.members[i]].camera;
      auto trajectory = std::find_if(map.trajectories.begin(), map.trajectories.end(),
                                     [&](const FrameTrajectory& known) { return known.label == label; });
      if (trajectory == map.trajectories.end())
        trajectory = map.trajectories.insert(trajectory, {label, {}, robot_from_optical[label]});
      trajectory->frames.insert(trajectory->frames.end(), merged.frames[i].begin(), merged.frames[i].end());
      std::stable_sort(trajectory->frames.begin(), trajectory->frames.end(),
                       [](const StampedPose& a, const StampedPose& b) { return a.stamp < b.stamp; });
    }
    map.trajectory = robot_trajectory_of(map.map, map.trajectories, odometry, options.trajectory);
    if (map.trajectories.size() == 1) continue;
    map.rig = {{}, merged.extrinsic_constraints, merged.apart_before_m, merged.apart_after_m, merged.solved};
    for (const FrameTrajectory& trajectory : map.trajectories) map.rig.cameras.push_back(trajectory.label);
  }
  return result;
}

// What became of what a camera had no room for; nothing where it had room for all.
std::optional<std::string> note_on_forgetting(const PlannedRobot& robot, const CameraReport& report, int most,
                                              bool has_server) {
  if (report.forgotten == 0) return std::nullopt;
  const std::string begin = "robot " + robot.id.str() + ": camera '" + report.label + "' had room for " +
                            std::to_string(most) + " keyframes (visual.memory.keyframes) and forgot " +
                            std::to_string(report.forgotten);
  if (!has_server)
    return begin + ": its map lacks them; allow more, or share with a camera map server (server.share=view)";
  return begin + "; its camera map server kept " + std::to_string(report.kept) + " of them, which the map holds";
}

// That it had no room for all that others shared; nothing where it had.
std::optional<std::string> note_on_dropping(const PlannedRobot& robot, const CameraReport& report, int most) {
  if (report.dropped_shared == 0) return std::nullopt;
  return "robot " + robot.id.str() + ": camera '" + report.label + "' had room for " + std::to_string(most) +
         " keyframes of others (visual.memory.shared_keyframes) and dropped the farthest, " +
         std::to_string(report.dropped_shared) + " times one; allow more, so that it goes on longer without its server";
}

// Why nothing was mapped.
Error nothing_tracked(const PlannedRobot& robot, const std::deque<Camera>& cameras) {
  for (const Camera& camera : cameras) {
    if (camera.report().frames == 0) continue;
    const std::vector<std::string> notes = camera.notes();
    return {ErrorCode::kBadInput,
            "none of the " + std::to_string(camera.report().frames) + " frames of camera '" + camera.report().label +
                "' could be placed: " +
                (notes.empty() ? "too few corners were seen, or the camera hardly moved" : notes.front()),
            robot.log.string(),
            notes.empty() ? "look at its pictures" : "mend the recording, or choose another --sensor"};
  }
  return {ErrorCode::kBadInput, "the log has no frames of its camera", robot.log.string(), "choose another sensor"};
}

}  // namespace

std::string sensor_name(const std::string& label) {
  const std::string name = made_valid(label);
  return name.empty() ? "camera" : name;
}

std::vector<StampedPose> robot_trajectory_of(const Map& map, const std::vector<FrameTrajectory>& trajectories,
                                             const std::vector<StampedPose>& odometry,
                                             const rig::RobotTrajectoryOptions& options) {
  // A camera counts by how much its keyframes see, above all of depth.
  constexpr double kDepth = 3.0;
  std::map<std::string, std::pair<double, double>> seen;  // of each: sightings, keyframes
  for (const auto& [id, node] : map.nodes) ++seen[id.session.client.sensor.str()].second;
  for (const auto& [id, landmark] : map.landmarks)
    for (const LandmarkSighting& sighting : landmark.seen)
      seen[sighting.node.session.client.sensor.str()].first += sighting.inverse_depth != 0 ? 1.0 + kDepth : 1.0;
  std::vector<rig::CameraTrajectory> cameras;
  for (const FrameTrajectory& trajectory : trajectories) {
    const auto [sightings, keyframes] = seen[sensor_name(trajectory.label)];
    cameras.push_back({trajectory.frames, (1.0 + sightings) / (1.0 + keyframes)});
  }
  return rig::robot_trajectory(cameras, odometry, options);
}

struct CameraTask::State {
  PlannedRobot robot;
  rawlog::ReadOptions reading;
  rig::RigOptions rig;
  bool keep_going = false;
  bool has_server = false;
  visual::MemoryOptions memory;  // of a camera
  std::deque<Camera> cameras;
  RobotLog log;
  laser::ScanPacker wheels_packer;
  std::vector<StampedPose> wheels;

  void add_wheels(const rawlog::Record& record) {
    if (dynamic_cast<const mrpt::obs::CObservationOdometry*>(record.observation.get()) == nullptr) return;
    if (const auto input = wheels_packer(record))
      wheels.push_back({record.stamp, std::get<laser::OdometryInput>(*input).odometry_from_robot});
  }

  explicit State(const PlannedRobot& planned) : robot(planned), log(planned) {}
};

CameraTask::CameraTask(const PlannedRobot& robot, const RunConfiguration& configuration, bool keep_going,
                       Progress& progress)
    : state_(new State(robot)) {
  state_->rig = configuration.rig;
  state_->keep_going = keep_going;
  state_->has_server = configuration.server.share != tiers::Sharing::none;
  state_->memory = configuration.visual.client.memory;
  for (const ChosenCamera& camera : robot.sensors.cameras)
    state_->cameras.emplace_back(camera, configuration.visual, configuration.seed);
  state_->log.guarded([&] { state_->log.begin(rawlog::open_log(robot.log, configuration.reading), progress); });
}
CameraTask::~CameraTask() = default;
CameraTask::CameraTask(CameraTask&&) noexcept = default;

std::optional<Stamp> CameraTask::next() const {
  return state_->log.next ? std::optional(state_->log.next->stamp) : std::nullopt;
}

void CameraTask::advance(std::optional<Stamp> until, const std::atomic<bool>& give_up) {
  State& state = *state_;
  state.log.guarded([&] {
    state.log.advance(until, give_up, [&](const rawlog::Record& record) {
      state.add_wheels(record);
      for (Camera& camera : state.cameras) camera.add(record);
      return true;
    });
  });
}

std::vector<CameraTask::Client> CameraTask::clients() {
  std::vector<Client> result;
  for (Camera& camera : state_->cameras)
    if (camera.client() != nullptr)
      result.push_back({camera.place(state_->robot.id), camera.client(), &camera.report(), &camera.kept()});
  return result;
}

CamerasOutcome CameraTask::finish() {
  State& state = *state_;
  const double before_s = thread_cpu_seconds();
  CamerasOutcome outcome;
  outcome.robot = state.robot;
  outcome.trouble = state.log.trouble;
  state.log.close();
  if (outcome.trouble && !state.keep_going) return outcome;
  std::vector<CameraMap> maps;
  for (Camera& camera : state.cameras) {
    outcome.log_seconds = std::max(outcome.log_seconds, camera.seconds());
    outcome.odometry.insert(outcome.odometry.end(), camera.odometry().begin(), camera.odometry().end());
    if (camera.tracked_anything()) {
      outcome.live.push_back(camera.take_live());
      outcome.cameras.push_back(camera.finish(state.robot.id, maps));
    } else if (camera.report().frames > 0) {
      log(LogLevel::warning, "robot " + state.robot.id.str() + ": none of the " +
                                 std::to_string(camera.report().frames) + " frames of camera '" +
                                 camera.report().label + "' could be placed");
    }
  }
  const auto by_stamp = [](const StampedPose& a, const StampedPose& b) { return a.stamp < b.stamp; };
  std::stable_sort(outcome.odometry.begin(), outcome.odometry.end(), by_stamp);
  outcome.odometry.erase(std::unique(outcome.odometry.begin(), outcome.odometry.end(),
                                     [](const StampedPose& a, const StampedPose& b) { return a.stamp == b.stamp; }),
                         outcome.odometry.end());
  outcome.wheels = std::move(state.wheels);
  outcome.doubts = state.log.units.notes();
  for (const CameraResult& camera : outcome.cameras) {
    if (auto note = note_on_forgetting(state.robot, camera.report, state.memory.keyframes, state.has_server))
      outcome.doubts.push_back(std::move(*note));
    if (auto note = note_on_dropping(state.robot, camera.report, state.memory.shared_keyframes))
      outcome.doubts.push_back(std::move(*note));
  }
  outcome.maps = merged_rig(std::move(maps), state.robot.id, outcome.odometry, state.rig, outcome.notes);
  if (outcome.maps.empty() && !outcome.trouble) outcome.trouble = nothing_tracked(state.robot, state.cameras);
  outcome.cpu_seconds = state.log.cpu_seconds + thread_cpu_seconds() - before_s;
  return outcome;
}

}  // namespace mapweave::runtime
