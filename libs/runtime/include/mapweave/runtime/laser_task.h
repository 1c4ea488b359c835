#pragma once
// One robot's planar scans, of a laser or of another sensor that makes such, from its log to its map, a moment at a
// time: the log's reader, the robot's agent and its SLAM instance, wired in one thread.

#include <mapweave/core/progress.h>
#include <mapweave/rig/fused_pose.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/tiers/robot_slam.h>

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

struct LaserOutcome {
  tiers::RobotOutcome outcome;
  RobotWork work;  // packing_s, mapping_s, sensed_bytes, repeated_s, repeated_bytes
  std::uint64_t scans = 0;
  double log_seconds = 0.0;        // of data
  double cpu_seconds = 0.0;        // the helper's left out
  std::vector<std::string> notes;  // what is implausible of the log's numbers
  rig::SpokenPoses live;           // where it was, as it came; none of engines that know it at their end alone
  std::vector<StampedPose> odometry;
};

// Not thread-safe, but each call may come from another thread.
class LaserTask {
 public:
  // `may_move`: what the robot sensed is kept, as it went over the wire, until finish().
  LaserTask(const PlannedRobot&, const RunConfiguration&, bool keep_going, bool may_move, Progress&);
  ~LaserTask();
  LaserTask(LaserTask&&) noexcept;

  std::optional<Stamp> next() const;  // of the log's next record; nullopt at its end
  // All records before `until`; nullopt: to the end. What goes wrong is the robot's trouble; throws Interrupted alone:
  // after a signal, or when `give_up` becomes true.
  void advance(std::optional<Stamp> until, const std::atomic<bool>& give_up);
  // Another edge maps from now on: it receives all that was sensed, from the beginning. Nothing happens where the robot
  // maps itself.
  void move();
  const std::optional<Error>& trouble() const;
  std::uint64_t scans() const;
  std::uint64_t sensed_bytes() const;  // that went to the edge so far
  Map map_so_far();                    // empty before there is one, and where mapping failed
  LaserOutcome finish();               // once

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::runtime
