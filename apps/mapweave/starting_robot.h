#pragma once
// A robot of a deployment, which starts once its log shows what it senses with.

#include <mapweave/runtime/live_robot.h>

#include <functional>
#include <future>
#include <mutex>
#include <optional>

namespace mapweave::app {

// Thread-safe. A log that is read while it is written (reading.follow) must be finished or closed before this is let go
// of.
class StartingRobot {
 public:
  // Looks into the log on a thread of its own, once there is one (has_log; null: it is there). The configuration must
  // outlive it. to_camera_map_server: as LiveRobot's.
  StartingRobot(runtime::PlannedRobot robot, const runtime::RunConfiguration& configuration,
                runtime::ConnectToEdge to_edge, runtime::ConnectCamera to_camera_map_server,
                std::function<bool()> has_log = nullptr);

  const RobotId& id() const { return id_; }
  // Now and then. True: it has started. Throws Error: kMissing where there is no log, and as LiveRobot does.
  bool look();
  // As LiveRobot's; where there is no log yet, its edge is informed that it has none. A log that is read while it is
  // written ends the drive when it is finished, and is read to its end.
  void end();
  void leave();  // as LiveRobot's
  void follow(const runtime::LivePlan& plan);
  void use(const runtime::LiveOptions& options);
  runtime::LiveRobotCounts counts() const;  // of one that has not started: that it has sensed nothing
  bool is_done() const;

 private:
  bool look_into_log();

  const RobotId id_;
  runtime::PlannedRobot robot_;  // its edge stays
  const runtime::RunConfiguration& configuration_;
  runtime::ConnectToEdge to_edge_;
  runtime::ConnectCamera to_camera_map_server_;
  std::function<bool()> has_log_;
  mutable std::mutex mutex_;
  std::future<runtime::PlannedRobot> looks_;
  std::optional<runtime::LivePlan> plan_;  // the last one before it started
  runtime::LiveOptions options_;
  bool ends_ = false;
  std::optional<runtime::LiveRobot> started_;
};

}  // namespace mapweave::app
