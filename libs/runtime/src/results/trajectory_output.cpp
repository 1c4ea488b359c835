#include "trajectory_output.h"

#include <mapweave/core/files.h>
#include <mapweave/exporters/trajectory_files.h>
#include <mapweave/rawlog/contents.h>

#include <algorithm>
#include <map>

namespace mapweave::runtime {
namespace {

std::vector<StampedPose> of_body(std::vector<StampedPose> poses, const Pose3& robot_from_body) {
  for (StampedPose& pose : poses) pose.map_from_robot = compose(pose.map_from_robot, robot_from_body);
  return poses;
}

void put(const std::filesystem::path& file, const std::vector<StampedPose>& poses) {
  std::filesystem::create_directories(file.parent_path());
  write_file(file, exporters::tum_text(poses));
}

// The robot's only camera; nullptr where there are several, or its cameras are not known.
const FrameTrajectory* only_camera(const std::vector<CamerasOutcome>& cameras, const RobotId& robot) {
  const FrameTrajectory* found = nullptr;
  for (const CamerasOutcome& outcome : cameras)
    for (const CameraMap& part : outcome.maps)
      for (const FrameTrajectory& trajectory : part.trajectories) {
        if (outcome.robot.id != robot) continue;
        if (found != nullptr && found->label != trajectory.label) return nullptr;
        found = &trajectory;
      }
  return found;
}

bool truth_follows_camera(const std::vector<CamerasOutcome>& cameras, const RobotId& robot) {
  return std::any_of(cameras.begin(), cameras.end(), [&](const CamerasOutcome& outcome) {
    return outcome.robot.id == robot && rawlog::truth_follows_camera(outcome.robot.log);
  });
}

}  // namespace

void write_camera_trajectories(const std::filesystem::path& folder, const CameraMap& part, const PlannedRobot& robot) {
  const bool is_single = part.trajectories.size() == 1;
  const bool follows_camera = is_single && rawlog::truth_follows_camera(robot.log);
  const auto keyframes = exporters::session_trajectories(part.map);
  const auto put_keyframes = [&](const std::filesystem::path& place, const FrameTrajectory& camera) {
    for (const exporters::SessionTrajectory& session : keyframes)
      if (session.session.client.sensor.str() == sensor_name(camera.label))
        put(place / "keyframes.tum",
            follows_camera ? of_body(session.poses, camera.robot_from_optical) : session.poses);
  };
  const FrameTrajectory& first = part.trajectories.front();
  put(folder / "trajectory.tum", follows_camera ? of_body(part.trajectory, first.robot_from_optical) : part.trajectory);
  put(folder / "trajectory.robot.tum", part.trajectory);
  put_keyframes(folder, first);
  for (const FrameTrajectory& camera : part.trajectories) {
    const std::filesystem::path place = is_single ? folder : folder / "cameras" / sensor_name(camera.label);
    put(place / "trajectory.optical.tum", of_body(camera.frames, camera.robot_from_optical));
    if (is_single) continue;
    put(place / "trajectory.tum", camera.frames);
    put_keyframes(place, camera);
  }
}

void write_team_trajectories(const std::filesystem::path& folder,
                             const std::vector<exporters::SessionTrajectory>& robots,
                             const std::vector<CamerasOutcome>& cameras, bool named) {
  std::map<RobotId, std::vector<StampedPose>> poses_of;
  for (const exporters::SessionTrajectory& session : robots) {
    auto& poses = poses_of[session.session.client.robot];
    poses.insert(poses.end(), session.poses.begin(), session.poses.end());
  }
  const std::filesystem::path place = folder / "trajectories";
  for (auto& [robot, poses] : poses_of) {
    const FrameTrajectory* camera = only_camera(cameras, robot);
    const bool follows_camera = camera != nullptr && truth_follows_camera(cameras, robot);
    const auto of_truth = follows_camera ? of_body(poses, camera->robot_from_optical) : poses;
    if (poses_of.size() == 1) put(folder / "trajectory.tum", of_truth);
    if (poses_of.size() == 1 && !named) continue;
    put(place / (robot.str() + ".tum"), of_truth);
    if (camera == nullptr) continue;
    put(place / "robot" / (robot.str() + ".tum"), poses);
    put(place / "optical" / (robot.str() + ".tum"), of_body(poses, camera->robot_from_optical));
  }
}

void write_robot_pose(const std::filesystem::path& folder, const rig::FusedTrajectory& pose) {
  if (pose.poses.empty()) return;
  put(folder / "robot.tum", pose.stamped());
  write_file(folder / "robot.sources.csv", pose.sources_csv());
}

}  // namespace mapweave::runtime
