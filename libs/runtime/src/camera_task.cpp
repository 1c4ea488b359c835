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
  Camera(const ChosenCamera& chosen, const visual::ClientOptions& options) : packer_({chosen.label, chosen.kind}), options_(options) {
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
  double seconds() const { return report_.frames == 0 ? 0.0 : seconds_between(first_, last_); }

  // Its nodes and landmarks go into the map, which both begin where the robot stood at the camera's first frame.
  CameraResult finish(RobotId robot, Map& map, std::vector<exporters::ColouredPoint>& landmarks) {
    CameraResult result;
    const Pose3 robot_from_camera = packer_.rig()->robot_from_camera, camera_from_robot = inverse(robot_from_camera);
    const auto map_from_robot = [&](const Pose3& first_from_camera) {
      return compose(compose(robot_from_camera, first_from_camera), camera_from_robot);
    };
    for (const visual::PlacedFrame& frame : client_->trajectory())
      result.frames.push_back({frame.stamp, map_from_robot(frame.map_from_camera)});
    const std::string name = made_valid(report_.label);
    const SessionId session{{robot, SensorId(name.empty() ? "camera" : name)}, first_.ns};
    std::uint32_t index = 0;
    for (const visual::PlacedFrame& keyframe : client_->keyframes()) {
      result.keyframes.push_back({keyframe.stamp, map_from_robot(keyframe.map_from_camera)});
      const NodeId id{session, index++};
      map.nodes.set(id, {id, keyframe.stamp, result.keyframes.back().map_from_robot, nullptr});
    }
    for (const visual::MappedLandmark& landmark : client_->landmarks())
      landmarks.push_back({transformed(landmark.point_in_map, robot_from_camera), {90, 90, 90}});
    report_.keyframes = result.keyframes.size(), report_.landmarks = client_->landmarks().size();
    report_.loops = static_cast<std::uint64_t>(client_->loops());
    report_.readout_s = client_->sensor().readout_s, report_.inverse_depth_offset = client_->sensor().inverse_depth_offset;
    const auto mean_ms = [](const std::vector<double>& seconds) {
      return seconds.empty() ? 0.0 : 1e3 * std::accumulate(seconds.begin(), seconds.end(), 0.0) / static_cast<double>(seconds.size());
    };
    report_.tracking_mean_ms = mean_ms(tracking_seconds_), report_.keyframe_mean_ms = mean_ms(keyframe_seconds_);
    report_.packing_mean_ms = 1e3 * packing_seconds_ / static_cast<double>(report_.frames);
    std::sort(tracking_seconds_.begin(), tracking_seconds_.end());
    if (!tracking_seconds_.empty()) report_.tracking_p99_ms = 1e3 * tracking_seconds_[(tracking_seconds_.size() - 1) * 99 / 100];
    result.report = report_;
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

  visual::FramePacker packer_;
  visual::ClientOptions options_;
  std::optional<visual::VisualClient> client_;
  CameraReport report_;
  SheetCollector sheet_;
  Stamp first_, last_, last_tracked_;
  std::vector<double> tracking_seconds_, keyframe_seconds_;
  double packing_seconds_ = 0.0;
};

void replay(const PlannedRobot& robot, const rawlog::ReadOptions& reading, std::deque<Camera>& cameras, const std::atomic<bool>& give_up,
            Progress& progress) {
  constexpr std::uint64_t kKilobyte = 1000;
  const auto log = rawlog::open_log(robot.log, reading);
  ProgressTask task(progress, "robot " + robot.id.str(), log->bytes_total() / kKilobyte, "kB");
  while (const auto record = log->next()) {
    throw_if_interrupted();
    if (give_up) throw Error(ErrorCode::kInterrupted, "given up, because another robot failed", "robot " + robot.id.str());
    for (Camera& camera : cameras) camera.add(*record);
    task.advance(log->bytes_read() / kKilobyte);
  }
}

// Why nothing was mapped.
Error nothing_tracked(const PlannedRobot& robot, const std::deque<Camera>& cameras) {
  for (const Camera& camera : cameras)
    if (camera.report().frames > 0)
      return {ErrorCode::kBadInput,
              "none of the " + std::to_string(camera.report().frames) + " frames of camera '" + camera.report().label +
                  "' could be placed: too few corners with depth were seen",
              robot.log.string(), "look at its pictures; check the depth scale, and whether left and right are exchanged"};
  return {ErrorCode::kBadInput, "the log has no frames of its camera", robot.log.string(), "choose another sensor"};
}

}  // namespace

CamerasOutcome map_cameras(const PlannedRobot& robot, const ChosenSensors& chosen, const RunConfiguration& configuration, bool keep_going,
                           const std::atomic<bool>& give_up, Progress& progress) {
  CamerasOutcome outcome;
  std::deque<Camera> cameras;
  for (const ChosenCamera& camera : chosen) cameras.emplace_back(camera, configuration.visual.client);
  try {
    replay(robot, configuration.reading, cameras, give_up, progress);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted) throw;
    outcome.trouble = error;
    if (!keep_going) return outcome;
  }
  Map map;
  map.id = MapId(robot.id.str());
  for (Camera& camera : cameras) {
    outcome.log_seconds = std::max(outcome.log_seconds, camera.seconds());
    if (camera.tracked_anything()) {
      outcome.cameras.push_back(camera.finish(robot.id, map, outcome.landmarks));
    } else if (camera.report().frames > 0) {
      log(LogLevel::warning, "robot " + robot.id.str() + ": none of the " + std::to_string(camera.report().frames) + " frames of camera '" +
                                 camera.report().label + "' could be placed");
    }
  }
  if (!map.empty())
    outcome.map = std::move(map);
  else if (!outcome.trouble)
    outcome.trouble = nothing_tracked(robot, cameras);
  return outcome;
}

}  // namespace mapweave::runtime
