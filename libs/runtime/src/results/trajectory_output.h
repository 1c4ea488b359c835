#pragma once
// Trajectories of cameras on disk. `trajectory.tum` follows the body that the ground truth of the robot's data set
// follows: the camera's optical frame where the log is a folder of TUM RGB-D or KITTI, else the robot's base.
// `trajectory.optical.tum` and `trajectory.robot.tum` hold what their names say.

#include <mapweave/exporters/session_trajectories.h>
#include <mapweave/runtime/camera_task.h>

namespace mapweave::runtime {

// Of a robot's own map, into `folder`, which is there: frames and keyframes; of several cameras each one's in
// cameras/NAME, where trajectory.tum is the robot's by that camera.
void write_camera_trajectories(const std::filesystem::path& folder, const CameraMap&, const PlannedRobot&);

// Of a team, into `folder`/trajectories: NAME.tum, and in robot/ and optical/ what those folders' names say, of
// robots that have one camera. One robot's also into `folder`/trajectory.tum; `named`: also into trajectories/.
void write_team_trajectories(const std::filesystem::path& folder,
                             const std::vector<exporters::SessionTrajectory>& robots,
                             const std::vector<CamerasOutcome>& cameras, bool named);

// A robot's pose as it came, into `folder`, which is there: robot.tum, and who gave each pose in robot.sources.csv.
void write_robot_pose(const std::filesystem::path& folder, const rig::FusedTrajectory& pose);

}  // namespace mapweave::runtime
