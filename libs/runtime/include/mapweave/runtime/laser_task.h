#pragma once
// One robot's planar scans, of a laser or of another sensor that makes such, from its log to its map, a moment at a
// time: the log's reader, the robot's agent and its SLAM instance, wired in one thread.

#include <mapweave/core/progress.h>
#include <mapweave/rig/fused_pose.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/runtime/timeline.h>
#include <mapweave/tiers/robot_slam.h>

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

struct LaserOutcome {
  tiers::RobotOutcome outcome;
  RobotWork work;  // holds packing_s, mapping_s, sensed_bytes, repeated_s, repeated_bytes
  std::uint64_t scans = 0;
  double log_seconds = 0.0;        // length of the log in data time
  double cpu_seconds = 0.0;        // without that of the helper process
  std::vector<std::string> notes;  // implausible numbers of the log
  rig::SpokenPoses live;           // the robot's pose while it drove; empty for engines that know it only at their end
  std::vector<StampedPose> odometry;
};

// Not thread-safe, but each call may come from another thread.
class LaserTask {
 public:
  // `may_move`: what the robot sensed is kept, as it went over the wire, until finish().
  LaserTask(const PlannedRobot&, const RunConfiguration&, bool keep_going, bool may_move, Progress&);
  ~LaserTask();
  LaserTask(LaserTask&&) noexcept;

  std::optional<Stamp> next() const;  // stamp of the log's next record; nullopt at the log's end
  // All records before `until`; nullopt: to the end. What goes wrong is the robot's trouble; throws Interrupted alone:
  // after a signal, or when `give_up` becomes true.
  void advance(std::optional<Stamp> until, const std::atomic<bool>& give_up);
  // Another edge maps from now on: it receives all that was sensed, from the beginning. Nothing happens where the robot
  // maps itself.
  void move();
  const std::optional<Error>& trouble() const;
  std::uint64_t scans() const;
  std::uint64_t sensed_bytes() const;  // bytes that went to the edge so far
  Map map_so_far();                    // empty before there is a map, and where mapping failed
  LaserOutcome finish();               // to be called once

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::runtime
