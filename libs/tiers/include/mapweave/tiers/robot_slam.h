#pragma once
// One SLAM instance of an edge: one robot's messages in, its map out when the stream has ended. Instances share
// nothing, so that an edge can run each on a thread of its own. A state machine: no thread, no clock, no file.

#include <mapweave/laser/laser_mapper.h>
#include <mapweave/maps/exchange.h>

#include <memory>
#include <optional>

namespace mapweave::tiers {

// How a robot's stream ended: a map, or trouble, or both (a log cut short: the map of what came before).
struct RobotOutcome {
  RobotId robot;
  std::optional<Map> map;
  std::optional<Error> trouble;
  double helper_cpu_seconds = 0.0;      // of the engine's child process; for reports
  std::vector<std::string> notes = {};  // what seems wrong with its sensors
  std::vector<Map> apart = {};          // more maps of its cameras, which did not find how they lie in the first
};

class RobotSlam {
 public:
  RobotSlam(RobotId robot, std::unique_ptr<laser::LaserMapper> mapper);

  // The outcome, once: at the end of the stream, or where the engine failed. What comes after it, and what came before,
  // is ignored; a gap in the numbers ends the stream. Whatever goes wrong is this robot's trouble; only Interrupted is
  // thrown.
  std::optional<RobotOutcome> step(Sensed);
  // Of the scans since the last call, as the mapper had placed them then; none after the outcome.
  std::vector<laser::LivePose> take_live_poses();
  // Empty after the outcome. An engine that failed says so with the next step.
  Map map_so_far();

 private:
  std::optional<RobotOutcome> act(Sensed);
  RobotOutcome finished(std::optional<Error> trouble);
  RobotOutcome failed(Error trouble);
  RobotId robot_;
  std::unique_ptr<laser::LaserMapper> mapper_;  // null after the outcome
  std::shared_ptr<const ScanGeometry>
      geometry_;  // of the last scan: scans of one laser share it, whatever they came over
  std::uint64_t expected_ = 1;
  bool anything_ = false;
};

}  // namespace mapweave::tiers
