#include <mapweave/runtime/camera_task.h>

#include "sheet_collector.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/runtime/metrics.h>
#include <mapweave/visual/visual_client.h>

#include <algorithm>
#include <deque>
#include <numeric>

namespace mapweave::runtime {
namespace {

const char* name_of(visual::CameraKind kind) {
  switch (kind) {
    case visual::CameraKind::rgbd: return "rgbd";
    case visual::CameraKind::stereo: return "stereo";
    default: return "mono";
  }
}

// A camera with its client, which begins with the first frame.
class Camera {
 public:
  Camera(const ChosenCamera& chosen, const visual::ClientOptions& options)
      : chosen_(chosen), packer_({chosen.label, chosen.kind}), options_(options) {
    report_.label = chosen.label, report_.kind = name_of(chosen.kind);
  }

  void add(const rawlog::Record& record) {
    const double before_s = thread_cpu_seconds();
    const auto frame = packer_(record);
    if (!frame) return;
    if (!client_) {
      client_.emplace(packer_.rig()->camera, packer_.rig()->baseline_m, options_, matching::shipped_vocabulary());
      first_ = frame->stamp;
    }
    const double packed_s = thread_cpu_seconds();
    const visual::Tracked tracked = client_->add(*frame);
    (tracked.keyframe ? keyframe_seconds_ : tracking_seconds_).push_back(thread_cpu_seconds() - packed_s);
    packing_seconds_ += packed_s - before_s;
    ++report_.frames;
    last_ = frame->stamp;
    note(tracked.state, frame->stamp);
    sheet_.add(*frame, tracked.state == visual::TrackState::tracked ? client_->seen() : std::vector<visual::SeenLandmark>{},
               seconds_between(first_, frame->stamp));
  }

  bool tracked_anything() const { return report_.tracked > 0; }
  const CameraReport& report() const { return report_; }
  std::vector<std::string> notes() const { return client_ ? client_->notes() : std::vector<std::string>{}; }
  double seconds() const { return report_.frames == 0 ? 0.0 : seconds_between(first_, last_); }

  visual::ClientPlace place(RobotId robot) const {
    return {{robot, SensorId(sensor_name(report_.label))}, packer_.rig()->robot_from_camera};
  }
  visual::VisualClient* client() { return client_ ? &*client_ : nullptr; }  // null before its first frame
  CameraReport& report() { return report_; }

  // Its maps, one for each session that stayed apart; each begins where the robot stood then.
  CameraResult finish(RobotId robot, std::vector<CameraMap>& maps) {
    CameraResult result;
    client_->finish();
    const Pose3 robot_from_camera = packer_.rig()->robot_from_camera, camera_from_robot = inverse(robot_from_camera);
    const std::vector<int> sessions = client_->sessions();
    std::vector<Map> told = client_->maps(place(robot));
    std::sort(told.begin(), told.end(), [](const Map& a, const Map& b) { return a.nodes.front().first < b.nodes.front().first; });
    std::vector<CameraMap> own(sessions.size());
    for (const visual::PlacedFrame& frame : client_->trajectory()) {
      CameraMap& part = own[static_cast<std::size_t>(std::lower_bound(sessions.begin(), sessions.end(), frame.session) - sessions.begin())];
      if (part.ways.empty()) part.ways.push_back({report_.label, {}});
      part.ways.front().frames.push_back({frame.stamp, compose(compose(robot_from_camera, frame.map_from_camera), camera_from_robot)});
    }
    MAPWEAVE_EXPECT(told.size() == own.size(), "each session has told of its map");
    for (std::size_t i = 0; i < own.size(); ++i) {
      own[i].map = std::move(told[i]);
      maps.push_back(std::move(own[i]));
    }
    report_.sessions = sessions.size();
    report_.keyframes = client_->keyframes().size(), report_.landmarks = client_->landmarks().size();
    for (const visual::ClosedLoop& loop : client_->loops())
      report_.loops.push_back({seconds_between(first_, loop.found), seconds_between(first_, loop.applied)});
    report_.readout_s = client_->sensor().readout_s, report_.inverse_depth_offset = client_->sensor().inverse_depth_offset;
    const auto mean_ms = [](const std::vector<double>& seconds) {
      return seconds.empty() ? 0.0 : 1e3 * std::accumulate(seconds.begin(), seconds.end(), 0.0) / static_cast<double>(seconds.size());
    };
    report_.tracking_mean_ms = mean_ms(tracking_seconds_), report_.keyframe_mean_ms = mean_ms(keyframe_seconds_);
    report_.packing_mean_ms = 1e3 * packing_seconds_ / static_cast<double>(report_.frames);
    std::sort(tracking_seconds_.begin(), tracking_seconds_.end());
    if (!tracking_seconds_.empty()) report_.tracking_p99_ms = 1e3 * tracking_seconds_[(tracking_seconds_.size() - 1) * 99 / 100];
    result.report = report_;
    result.chosen = chosen_;
    result.notes = client_->notes();
    result.sheet = sheet_.take();
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
  visual::ClientOptions options_;
  std::optional<visual::VisualClient> client_;
  CameraReport report_;
  SheetCollector sheet_;
  Stamp first_, last_, last_tracked_;
  std::vector<double> tracking_seconds_, keyframe_seconds_;
  double packing_seconds_ = 0.0;
};

std::size_t frames_of(const CameraMap& map) {
  std::size_t count = 0;
  for (const CameraWay& way : map.ways) count += way.frames.size();
  return count;
}

// Cameras of one robot see one world: what began while another camera was placed begins where that one says the robot was.
std::vector<CameraMap> placed_together(std::vector<CameraMap> maps, RobotId robot) {
  constexpr double kSameTime_s = 0.25;
  std::stable_sort(maps.begin(), maps.end(), [](const CameraMap& a, const CameraMap& b) { return frames_of(a) > frames_of(b); });
  std::vector<CameraMap> result;
  for (CameraMap& map : maps) {
    const CameraWay& way = map.ways.front();
    bool placed = false;
    for (CameraMap& known : result) {
      if (known.ways.front().label == way.label) continue;
      const auto known_from_map = exporters::pose_at(known.ways.front().frames, way.frames.front().stamp, kSameTime_s);
      if (!known_from_map) continue;
      // The part's own map begins at the identity but for what its first frame was corrected by since.
      const Pose3 motion = compose(*known_from_map, inverse(way.frames.front().map_from_robot));
      for (auto [id, node] : map.map.nodes) {
        node.map_from_node = compose(motion, node.map_from_node);
        known.map.nodes.set(id, std::move(node));
      }
      for (const auto& [id, landmark] : map.map.landmarks) known.map.landmarks.set(id, landmark);
      known.ways.push_back(way);
      for (exporters::StampedPose& pose : known.ways.back().frames) pose.map_from_robot = compose(motion, pose.map_from_robot);
      placed = true;
      break;
    }
    if (!placed) result.push_back(std::move(map));
  }
  for (std::size_t i = 0; i < result.size(); ++i) result[i].map.id = MapId(i == 0 ? robot.str() : robot.str() + "." + std::to_string(i));
  return result;
}

// Why nothing was mapped.
Error nothing_tracked(const PlannedRobot& robot, const std::deque<Camera>& cameras) {
  for (const Camera& camera : cameras) {
    if (camera.report().frames == 0) continue;
    const std::vector<std::string> notes = camera.notes();
    return {ErrorCode::kBadInput,
            "none of the " + std::to_string(camera.report().frames) + " frames of camera '" + camera.report().label +
                "' could be placed: " + (notes.empty() ? "too few corners were seen, or the camera hardly moved" : notes.front()),
            robot.log.string(), notes.empty() ? "look at its pictures" : "mend the recording, or choose another --sensor"};
  }
  return {ErrorCode::kBadInput, "the log has no frames of its camera", robot.log.string(), "choose another sensor"};
}

}  // namespace

std::string sensor_name(const std::string& label) {
  const std::string name = made_valid(label);
  return name.empty() ? "camera" : name;
}

struct CameraTask::State {
  PlannedRobot robot;
  rawlog::ReadOptions reading;
  bool keep_going = false;
  std::deque<Camera> cameras;
  std::unique_ptr<rawlog::ObservationStream> log;
  std::optional<ProgressTask> task;
  std::optional<rawlog::Record> next;
  std::optional<Error> trouble;
  double cpu_seconds = 0.0;

  // Runs what may meet trouble with the log; its end then.
  template <class Reading>
  void guarded(const Reading& reading_on) {
    const double before_s = thread_cpu_seconds();
    try {
      reading_on();
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kInterrupted) throw;
      trouble = error;
      next.reset();
    }
    cpu_seconds += thread_cpu_seconds() - before_s;
  }
};

CameraTask::CameraTask(const PlannedRobot& robot, const ChosenSensors& chosen, const RunConfiguration& configuration, bool keep_going,
                       Progress& progress)
    : state_(new State) {
  constexpr std::uint64_t kKilobyte = 1000;
  state_->robot = robot, state_->keep_going = keep_going;
  visual::ClientOptions options = configuration.visual.client;
  options.seed = configuration.seed;
  for (const ChosenCamera& camera : chosen.cameras) state_->cameras.emplace_back(camera, options);
  state_->guarded([&] {
    state_->log = rawlog::open_log(robot.log, configuration.reading);
    state_->task.emplace(progress, "robot " + robot.id.str(), state_->log->bytes_total() / kKilobyte, "kB");
    state_->next = state_->log->next();
  });
}
CameraTask::~CameraTask() = default;
CameraTask::CameraTask(CameraTask&&) noexcept = default;

std::optional<Stamp> CameraTask::next() const { return state_->next ? std::optional(state_->next->stamp) : std::nullopt; }

void CameraTask::advance(std::optional<Stamp> until, const std::atomic<bool>& give_up) {
  constexpr std::uint64_t kKilobyte = 1000;
  State& state = *state_;
  state.guarded([&] {
    while (state.next && (!until || state.next->stamp < *until)) {
      throw_if_interrupted();
      if (give_up) throw Error(ErrorCode::kInterrupted, "given up, because another robot failed", "robot " + state.robot.id.str());
      for (Camera& camera : state.cameras) camera.add(*state.next);
      state.task->advance(state.log->bytes_read() / kKilobyte);
      state.next = state.log->next();
    }
  });
}

std::vector<CameraTask::Client> CameraTask::clients() {
  std::vector<Client> result;
  for (Camera& camera : state_->cameras)
    if (camera.client() != nullptr) result.push_back({camera.place(state_->robot.id), camera.client(), &camera.report()});
  return result;
}

CamerasOutcome CameraTask::finish() {
  State& state = *state_;
  const double before_s = thread_cpu_seconds();
  CamerasOutcome outcome;
  outcome.robot = state.robot, outcome.trouble = state.trouble;
  state.task.reset(), state.log.reset();
  if (outcome.trouble && !state.keep_going) return outcome;
  std::vector<CameraMap> maps;
  for (Camera& camera : state.cameras) {
    outcome.log_seconds = std::max(outcome.log_seconds, camera.seconds());
    if (camera.tracked_anything()) {
      outcome.cameras.push_back(camera.finish(state.robot.id, maps));
    } else if (camera.report().frames > 0) {
      log(LogLevel::warning, "robot " + state.robot.id.str() + ": none of the " + std::to_string(camera.report().frames) +
                                 " frames of camera '" + camera.report().label + "' could be placed");
    }
  }
  outcome.maps = placed_together(std::move(maps), state.robot.id);
  if (outcome.maps.empty() && !outcome.trouble) outcome.trouble = nothing_tracked(state.robot, state.cameras);
  outcome.cpu_seconds = state.cpu_seconds + thread_cpu_seconds() - before_s;
  return outcome;
}

}  // namespace mapweave::runtime
