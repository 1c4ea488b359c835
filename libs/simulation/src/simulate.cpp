#include <mapweave/simulation/simulate.h>

#include "camera_log.h"

#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/rawlog/rawlog_writer.h>
#include <mapweave/simulation/observations.h>
#include <mapweave/simulation/world.h>

#include <string>
#include <utility>

namespace mapweave::simulation {
namespace {

// The records of one robot in the order of their stamps; of equal stamps odometry, the scan, the inertial unit, then
// cameras.
class RobotLog {
 public:
  RobotLog(const World& world, std::size_t robot, const std::filesystem::path& folder)
      : world_(world),
        robot_(robot),
        name_(world.robot_id(robot).str()),
        folder_(folder),
        writer_(folder / (name_ + ".rawlog")),
        recording_(world, robot),
        imu_(world, robot),
        reading_(imu_.next()) {
    for (std::size_t camera = 0; camera < world.cameras(robot).size(); ++camera)
      cameras_.push_back({CameraLog(world, robot, camera, folder), 0});
    step_ = recording_.next();
  }

  SimulatedLog write(WorkerPool& pool, Progress& progress) {
    SimulatedLog log{name_, 0, 0, world_.trajectory(robot_).length_m(), world_.trajectory(robot_).duration_s()};
    std::size_t total = world_.scan_count(robot_);
    for (const Camera& camera : cameras_) total += camera.log.recording().frame_count();
    ProgressTask task(progress, "simulate " + name_, total, cameras_.empty() ? "scans" : "scans and frames");
    std::vector<CameraRecording::Workspace> workspaces(4 * static_cast<std::size_t>(pool.threads()));
    while (gather(workspaces.size())) {
      throw_if_interrupted();
      std::vector<Item*> frames;
      for (Item& item : items_) {
        if (item.camera != nullptr) frames.push_back(&item);
      }
      pool.for_each(frames.size(), [&](std::size_t i) {
        frames[i]->entry = frames[i]->camera->log.make(frames[i]->frame, workspaces[i]);
      });
      for (Item& item : items_) {
        if (item.camera != nullptr) item.camera->log.add(item.entry);
        const auto& observation = item.camera != nullptr ? item.entry.observation : item.ready;
        if (observation) writer_.add(*observation);
      }
      log.scans = scans_;
      log.frames += frames.size();
      task.advance(log.scans + log.frames);
    }
    writer_.close();
    write_file(folder_ / (name_ + ".truth.tum"), truth_);
    for (Camera& camera : cameras_) camera.log.close();
    return log;
  }

 private:
  struct Camera {
    CameraLog log;
    std::size_t next;
  };
  struct Item {
    mrpt::obs::CObservation::Ptr ready;
    Camera* camera = nullptr;
    std::size_t frame = 0;
    CameraLog::Entry entry{};
  };

  // Whatever comes next, until there are enough frames to be made at once, or enough of the rest. False at the end.
  bool gather(std::size_t frames_at_once) {
    constexpr std::size_t kMostItems = 256;
    items_.clear();
    for (std::size_t frames = 0; frames < frames_at_once && items_.size() < kMostItems;) {
      Camera* earliest = nullptr;
      for (Camera& camera : cameras_) {
        if (camera.next < camera.log.recording().frame_count() &&
            (earliest == nullptr || next_stamp(camera) < next_stamp(*earliest)))
          earliest = &camera;
      }
      if (step_ && (!reading_ || step_->stamp <= reading_->stamp) &&
          (earliest == nullptr || step_->stamp <= next_stamp(*earliest))) {
        add_step(*step_);
        step_ = recording_.next();
      } else if (reading_ && (earliest == nullptr || reading_->stamp <= next_stamp(*earliest))) {
        items_.push_back({imu_observation(*reading_)});
        reading_ = imu_.next();
      } else if (earliest != nullptr) {
        items_.push_back({nullptr, earliest, earliest->next++});
        ++frames;
      } else {
        break;
      }
    }
    return !items_.empty();
  }

  static Stamp next_stamp(const Camera& camera) { return camera.log.recording().stamp(camera.next); }

  void add_step(const SimulatedStep& step) {
    items_.push_back({odometry_observation(step)});
    if (step.ranges.empty()) return;
    if (world_.options().logs.scans) items_.push_back({scan_observation(step, world_.options().laser)});
    const double seconds = seconds_between(world_.first_stamp(robot_), step.stamp);
    truth_ += tum_line(step.stamp, world_.world_from_robot(robot_, seconds));
    ++scans_;
  }

  const World& world_;
  std::size_t robot_, scans_ = 0;
  std::string name_, truth_;
  std::filesystem::path folder_;
  rawlog::RawlogWriter writer_;
  Recording recording_;
  ImuRecording imu_;
  std::optional<SimulatedStep> step_;
  std::optional<ImuReading> reading_;
  std::vector<Camera> cameras_;
  std::vector<Item> items_;
};

std::string run_configuration(const WorldOptions& options) {
  std::string text =
      "# A simulated world, seed " + std::to_string(options.seed) + ": mapweave run run.yaml --out DIR\nrobots:\n";
  int turn = 0;
  for (const RobotOptions& robot : options.robots) {
    const std::string edge = robot.edge.empty() ? "edge" + std::to_string(turn++ % options.edges) : robot.edge;
    text += "  - {id: \"" + robot.id + "\", log: \"" + robot.id + ".rawlog\", edge: \"" + edge + "\"}\n";
  }
  return text;
}

}  // namespace

std::vector<SimulatedLog> simulate(const WorldOptions& options, const std::filesystem::path& folder, WorkerPool& pool,
                                   Progress& progress) {
  const World world(options, pool);
  auto logs = pool.map(world.robot_count(),
                       [&](std::size_t robot) { return RobotLog(world, robot, folder).write(pool, progress); });
  write_file(folder / "run.yaml", run_configuration(world.options()));
  return logs;
}

}  // namespace mapweave::simulation
