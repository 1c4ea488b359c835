#include "initial_pose.h"

#include <mapweave/core/error.h>

#include <optional>

namespace mapweave::ros_nodes {
namespace {

constexpr double kSigma_m = 0.05, kSigma_rad = 0.02;  // of where the map shows the other robot's start

struct Drive {
  Pose3 first, last;  // of the robot, in the part
  Stamp first_stamp, last_stamp;
};

// A robot's way through a part; none where it is not in it.
std::optional<Drive> drive_of(const RobotId& robot, const Map& map) {
  std::optional<Drive> drive;
  for (const auto& [id, node] : map.nodes) {
    if (id.session.client.robot != robot) continue;
    if (!drive) drive = Drive{node.map_from_node, node.map_from_node, node.stamp, node.stamp};
    if (node.stamp.ns < drive->first_stamp.ns) {
      drive->first = node.map_from_node;
      drive->first_stamp = node.stamp;
    }
    if (node.stamp.ns >= drive->last_stamp.ns) {
      drive->last = node.map_from_node;
      drive->last_stamp = node.stamp;
    }
  }
  return drive;
}

runtime::StartPose start_pose(const Pose2& pose, double sigma_m, double sigma_rad) {
  return {pose.x, pose.y, pose.phi, sigma_m, sigma_rad};
}

}  // namespace

void add_pose(const GivenPose& pose, const runtime::LivePreview& preview,
              const runtime::RunConfiguration& configuration, runtime::LiveRequests& requests) {
  if (preview.parts.empty())
    throw Error(ErrorCode::kBadInput, "there is no map yet in which robot '" + pose.robot.str() + "' could be", {},
                "wait for the first preview");
  const Map& largest = preview.parts.front().map;
  std::optional<RobotId> other;
  for (const RobotId& robot : largest.robots())
    if (robot != pose.robot) {
      other = robot;
      break;
    }
  if (!other)
    throw Error(ErrorCode::kBadInput, "the largest map has no robot but '" + pose.robot.str() + "'", {},
                "give the pose of a robot of another map in this one");
  // How far the robot has come from its start, by its own map.
  Pose3 start_from_robot;
  for (const runtime::LivePreview::Part& part : preview.parts)
    if (const auto drive = drive_of(pose.robot, part.map))
      start_from_robot = compose(inverse(drive->first), drive->last);
  const Pose2 team_from_start = planar(compose(spatial(pose.team_from_robot), inverse(start_from_robot)));
  const Pose2 team_from_other = planar(drive_of(*other, largest)->first);
  const runtime::StartPose known = start_of(configuration, requests, *other);
  if (known.sigma_m > 0.0) {  // starts are in another frame than the map's
    const Pose3 shared_from_team =
        compose(spatial(Pose2(known.x_m, known.y_m, known.yaw_rad)), inverse(spatial(team_from_other)));
    requests.starts[pose.robot] =
        start_pose(planar(compose(shared_from_team, spatial(team_from_start))), pose.sigma_m, pose.sigma_rad);
    return;
  }
  requests.starts[*other] = start_pose(team_from_other, kSigma_m, kSigma_rad);
  requests.starts[pose.robot] = start_pose(team_from_start, pose.sigma_m, pose.sigma_rad);
}

}  // namespace mapweave::ros_nodes
