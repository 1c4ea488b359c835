#include "initial_pose.h"

#include "robot_map.h"

#include <mapweave/core/error.h>

#include <optional>

namespace mapweave::ros_nodes {
namespace {

constexpr double kSigma_m = 0.05, kSigma_rad = 0.02;  // of where the map shows the other robot's start

runtime::StartPose start_pose(const Pose3& pose, double sigma_m, double sigma_rad) {
  const Pose2 planar_pose = planar(pose);
  return {planar_pose.x, planar_pose.y, planar_pose.phi, sigma_m, sigma_rad};
}

}  // namespace

void add_pose(const GivenPose& pose, const runtime::LivePreview& preview,
              const runtime::RunConfiguration& configuration, runtime::LiveRequests& requests) {
  if (preview.parts.empty())
    throw Error(ErrorCode::kBadInput, "there is no map yet in which robot '" + pose.robot.str() + "' could be", {},
                "wait for the first preview");
  std::optional<RobotMap> other;
  RobotId other_robot;
  for (const RobotId& robot : preview.parts.front().map.robots()) {
    if (robot == pose.robot) continue;
    other = robot_map(preview, robot);
    other_robot = robot;
    if (other->part == 0) break;
    other.reset();
  }
  if (!other)
    throw Error(ErrorCode::kBadInput, "the largest map has no robot but '" + pose.robot.str() + "'", {},
                "give the pose of a robot of another map in this one");
  const auto own = robot_map(preview, pose.robot);
  const Pose3 start_from_robot = own ? own->trajectory.back().map_from_robot : Pose3();
  const Pose3 team_from_start = compose(spatial(pose.team_from_robot), inverse(start_from_robot));
  const runtime::StartPose known = start_of(configuration, requests, other_robot);
  if (known.sigma_m > 0.0) {  // starts are in another frame than the map's
    const Pose3 starts_from_team =
        compose(spatial(Pose2(known.x_m, known.y_m, known.yaw_rad)), inverse(other->part_from_robot_map));
    requests.starts[pose.robot] = start_pose(compose(starts_from_team, team_from_start), pose.sigma_m, pose.sigma_rad);
    return;
  }
  requests.starts[other_robot] = start_pose(other->part_from_robot_map, kSigma_m, kSigma_rad);
  requests.starts[pose.robot] = start_pose(team_from_start, pose.sigma_m, pose.sigma_rad);
}

}  // namespace mapweave::ros_nodes
