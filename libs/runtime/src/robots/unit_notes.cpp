#include "unit_notes.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <variant>

namespace mapweave::runtime {

void UnitNotes::add(const rawlog::Record& record) {
  if (const auto* odometry = dynamic_cast<const mrpt::obs::CObservationOdometry*>(record.observation.get()))
    odometry_.add_odometry(odometry->odometry.asTPose());
  say(check_.add(record));
}

void UnitNotes::look_at(const Sensed& sensed) {
  if (const auto* scan = std::get_if<PackedScan>(&sensed.body))
    if (const auto doubt = odometry_.add_scan(sensed.stamp, *scan)) say({*doubt});
}

void UnitNotes::say(const std::vector<rawlog::UnitDoubt>& doubts) {
  for (const rawlog::UnitDoubt& doubt : doubts) {
    if (doubt.nothing_is_left)
      throw Error(ErrorCode::kBadInput, "nothing can be mapped: " + doubt.what, log_.string(),
                  doubt.guess + " Logs hold metres and radians: convert it");
    notes_.push_back("robot " + robot_.str() + ": " + doubt.what + ": " + doubt.guess);
    log(LogLevel::warning, notes_.back());
  }
}

std::optional<std::string> note_on_packing(const RobotId& robot, const laser::ScanPacker& packer,
                                           const laser::LaserOptions& options) {
  for (const auto& [label, count] : packer.ignored_lasers())
    log(LogLevel::info, "robot " + robot.str() + ": " + std::to_string(count) + " scans of laser '" + label +
                            "' are not used; '" + packer.label() + "' is (choose with --set laser.scan.label=...)");
  if (packer.unusable() > 0)
    log(LogLevel::warning,
        "robot " + robot.str() + ": " + std::to_string(packer.unusable()) + " records made no sense and were left out");
  if (!packer.found_inertial() || options.engine == laser::Engine::graph ||
      options.scan.inertial == laser::InertialUse::none)
    return std::nullopt;
  return "robot " + robot.str() +
         ": its inertial unit is not used: the laser engines rbpf and icp ignore it, laser.engine=graph uses it";
}

}  // namespace mapweave::runtime
