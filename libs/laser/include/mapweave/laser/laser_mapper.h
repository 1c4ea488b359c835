#pragma once
// One robot's grid SLAM: what every engine offers. An engine has no thread and no clock of its own: feed it in data
// time, read it.

#include <mapweave/core/progress.h>
#include <mapweave/maps/map_update.h>

#include <memory>
#include <string>
#include <variant>
#include <vector>

namespace mapweave::laser {

struct ScanInput {
  Stamp stamp;
  PackedScan scan;
};
struct OdometryInput {
  Stamp stamp;
  Pose3 odometry_from_robot;  // accumulated since any start; may drift, never jumps but where the wheels slip
};
struct InertialInput {
  Stamp stamp;
  double yaw_rad = 0.0;  // heading accumulated since any start, not wrapped; drifts
};
using LaserInput = std::variant<ScanInput, OdometryInput, InertialInput>;

// Where the robot was when it took a scan, by what was known then: later loop closures do not change it.
struct LivePose {
  Stamp stamp;
  Pose3 map_from_robot;
  bool is_matched = true;  // false: the scan fitted nowhere, and odometry alone says where
};

// Not thread-safe. The map's frame is the robot's pose at the first scan.
class LaserMapper {
 public:
  // In the order of stamps; odometry of a stamp before the scan of that stamp where both exist. Throws Error where the
  // engine itself failed (a helper process that ended), never for a scan that does not fit.
  virtual void add(const LaserInput&) = 0;
  // Last loops, final refinement. Called once; no add() after.
  virtual void finish() = 0;
  // Before finish(): makes snapshot() show what was added, for an engine that would show it at its end alone. Throws as
  // add() does.
  virtual void catch_up() {}
  // The map so far; before finish() an engine may begin it anew. Every scan is a node; scans that showed nothing new
  // have no payload.
  virtual Map snapshot() const = 0;
  // Of the scans that were placed since the last call, by stamp. None of an engine that knows them at its end alone.
  virtual std::vector<LivePose> take_live_poses() { return {}; }
  // After finish(): what seems wrong with the robot's sensors, for people.
  virtual std::vector<std::string> notes() const { return {}; }
  // Processor time of child processes that have ended; for reports.
  virtual double helper_cpu_seconds() const { return 0.0; }
  virtual ~LaserMapper() = default;
};

}  // namespace mapweave::laser
