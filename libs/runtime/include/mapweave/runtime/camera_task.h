#pragma once
// One robot's cameras from its log to their maps, in one thread and by data time (lockstep).

#include <mapweave/core/progress.h>
#include <mapweave/exporters/contact_sheet.h>
#include <mapweave/exporters/session_trajectories.h>
#include <mapweave/rig/fused_pose.h>
#include <mapweave/rig/rig.h>
#include <mapweave/runtime/report.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/tiers/kept_map.h>
#include <mapweave/visual/visual_client.h>

#include <atomic>
#include <memory>
#include <optional>
#include <vector>

namespace mapweave::runtime {

struct CameraResult {
  ChosenCamera chosen;
  CameraReport report;
  std::vector<exporters::SheetFrame> sheet;  // a few frames, spread over the time
  std::vector<std::string> notes;            // what seems wrong with its pictures
};

// The robot's poses by one camera's frames.
struct FrameTrajectory {
  std::string label;
  std::vector<StampedPose> frames;
  Pose3 robot_from_optical = {};  // the camera's optical frame, as it is mounted
};

// A camera's name among the robot's sensors, and of its folder.
std::string sensor_name(const std::string& label);

struct CameraMap {
  Map map;                                    // keyframes and landmarks
  std::vector<FrameTrajectory> trajectories;  // one for each camera; the first one gave the frame
  std::vector<StampedPose> trajectory;        // the robot's trajectory by all cameras
  RigReport rig;                              // report where several cameras are in one map
};

// The robot's trajectory by all its cameras: `trajectories` are those of the map's cameras, or what became of them
// elsewhere.
std::vector<StampedPose> robot_trajectory_of(const Map&, const std::vector<FrameTrajectory>& trajectories,
                                             const std::vector<StampedPose>& odometry,
                                             const rig::RobotTrajectoryOptions&);

struct CamerasOutcome {
  PlannedRobot robot;
  std::vector<CameraResult> cameras;  // cameras that tracked anything, by label
  // The one with most frames first, which has the robot's name; others are apart from it: a camera was lost, went on
  // elsewhere and never came back to a place that it knew.
  std::vector<CameraMap> maps;
  std::vector<std::string> notes;      // why its cameras left several maps
  std::vector<std::string> doubts;     // implausible numbers of the log; keyframes without room
  std::vector<StampedPose> odometry;   // the robot's poses by odometry at its cameras' frames, in a frame of its own
  std::vector<rig::SpokenPoses> live;  // the robot's pose by each camera while it drove; by label
  std::vector<StampedPose> wheels;     // odometry at its own rate
  double log_seconds = 0.0;
  double cpu_seconds = 0.0;
  std::optional<Error> trouble;  // why the stream ended early, or why there is no map
};

// Not thread-safe, but each call may come from another thread.
class CameraTask {
 public:
  // With `keep_going` what comes before trouble with the log is mapped.
  CameraTask(const PlannedRobot&, const RunConfiguration&, bool keep_going, Progress&);
  ~CameraTask();
  CameraTask(CameraTask&&) noexcept;

  std::optional<Stamp> next() const;  // stamp of the log's next record; nullopt at the log's end
  // All records before `until`; nullopt: to the end. Throws Interrupted alone: after a signal, or when `give_up`
  // becomes true.
  void advance(std::optional<Stamp> until, const std::atomic<bool>& give_up);

  struct Client {
    visual::ClientPlace place;
    visual::VisualClient* client;
    CameraReport* report;
    std::vector<tiers::KeptMap>* kept;  // output: what the camera map server keeps for it
  };
  std::vector<Client> clients();  // clients of cameras that have had a frame, by label; valid until finish()
  CamerasOutcome finish();        // to be called once

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::runtime
