#pragma once
// Watches the beginning of a robot's log for numbers that cannot be metres and radians.

#include <mapweave/laser/odometry_check.h>
#include <mapweave/laser/scan_input.h>
#include <mapweave/maps/exchange.h>
#include <mapweave/rawlog/unit_check.h>
#include <mapweave/runtime/run_configuration.h>

#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

// Doubts are logged at once, as warnings, and kept as notes. Not thread-safe.
class UnitNotes {
 public:
  explicit UnitNotes(const PlannedRobot& robot) : robot_(robot.id), log_(robot.log) {}
  void add(const rawlog::Record& record);  // throws Error where nothing can be mapped
  void look_at(const Sensed& sensed);      // of what add() was given
  void finish() { say(check_.finish()); }  // as add(), of the end of the log
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  void say(const std::vector<rawlog::UnitDoubt>& doubts);
  RobotId robot_;
  std::filesystem::path log_;
  rawlog::UnitCheck check_;
  laser::OdometryCheck odometry_;
  std::vector<std::string> notes_;
};

// What a packer that has seen the whole log left out: logged, and what matters returned as a note.
std::optional<std::string> note_on_packing(const RobotId& robot, const laser::ScanPacker& packer,
                                           const laser::LaserOptions& options);

}  // namespace mapweave::runtime
