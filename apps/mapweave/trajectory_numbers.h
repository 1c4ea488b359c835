#pragma once
// What evaluate says of trajectories: errors of a run, of each of its robots, and of all together.

#include "evaluated_runs.h"

#include <mapweave/evaluation/absolute_error.h>
#include <mapweave/exporters/trajectory_plot.h>

#include <nlohmann/json.hpp>

#include <optional>
#include <string>
#include <vector>

namespace mapweave::app {

struct TrajectoryJudging {
  std::filesystem::path reference, times;          // the reference a file or a folder; `times`: of KITTI's poses
  std::optional<evaluation::AlignmentKind> align;  // nullopt: se2 where all is planar, else se3
  evaluation::TrajectoryErrorOptions error;        // its `align` is not asked
  evaluation::RelativeErrorOptions relative;
  Pose3 robot_from_sensor;        // where the reference follows a sensor and the estimate the robot
  bool removes_rotation = false;  // a constant rotation between both is taken out, not only reported
};

struct JudgedRun {
  std::string name;
  nlohmann::ordered_json numbers;                                      // of all robots together
  std::vector<std::pair<std::string, nlohmann::ordered_json>> robots;  // of a team's, each
  std::vector<std::string> notes;                                      // for people
  std::vector<exporters::PlottedTrack> tracks;
};

// Throws Error: what reading throws, kBadInput where no stamps match or no alignment is determined.
JudgedRun judged(const EvaluatedRun&, const TrajectoryJudging&);

// "optical", x,y,yaw or x,y,z,qx,qy,qz,qw: the pose of a sensor on its robot. Throws Error(kUsage).
Pose3 sensor_pose(const std::string& text);

}  // namespace mapweave::app
