#pragma once
// A robot that maps on board: its recording a moment at a time, and what it says to its edge at the end.

#include "robot_record.h"

#include <mapweave/core/stopwatch.h>
#include <mapweave/maps/exchange.h>
#include <mapweave/runtime/camera_task.h>
#include <mapweave/runtime/laser_task.h>

#include <atomic>
#include <memory>
#include <optional>
#include <vector>

namespace mapweave::runtime {

// Whether it does: with cameras always, with a laser alone in mode onboard.
bool maps_on_board(const PlannedRobot& robot, const RunConfiguration& configuration);

// Not thread-safe, but each call may come from another thread.
class OnBoardMapping {
 public:
  // A laser, cameras, or both; the plan's sensors are chosen. What is wrong with the log is the robot's trouble.
  OnBoardMapping(const PlannedRobot& robot, const RunConfiguration& configuration);
  ~OnBoardMapping();

  std::optional<Stamp> next() const;  // of the log's next record; nullopt at its end
  // All records before `until`. Throws Interrupted alone: after a signal, or when `give_up` becomes true.
  void advance(Stamp until, const std::atomic<bool>& give_up);
  std::uint64_t seen();                       // scans or frames so far
  std::vector<CameraTask::Client> cameras();  // as CameraTask::clients(); valid until finish()

  // Its maps and its report as messages, in order, from number 1 on; then the end. Once.
  // notes: what else is to be said of its mapping.
  std::vector<Sensed> finish(bool was_asked_to_end, std::vector<std::string> notes = {});
  const std::optional<Error>& trouble() const { return trouble_; }  // with its log; after finish()

 private:
  void add_laser(RobotRecord& record, std::vector<Map>& maps);
  void add_cameras(RobotRecord& record, std::vector<Map>& maps);

  PlannedRobot robot_;
  std::unique_ptr<Progress> silent_;
  Stopwatch watch_;
  std::optional<Error> trouble_;
  std::optional<LaserTask> laser_;
  std::optional<CameraTask> cameras_;
};

// What an edge receives of such a robot, put together again.
class OnBoardParts {
 public:
  // Throws Error (kCorrupt, kBadInput) for what is not sound, or of another robot.
  void add(MappedPart part, const RobotId& robot);
  std::optional<RobotRecord> record;
  std::vector<Map> maps;  // the main one first, which has the robot's name

 private:
  std::string bytes_;
};

}  // namespace mapweave::runtime
