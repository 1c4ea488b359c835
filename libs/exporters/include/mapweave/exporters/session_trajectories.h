#pragma once
// The trajectories of a map's robots.

#include <mapweave/core/stamped_pose.h>
#include <mapweave/maps/map.h>

#include <map>
#include <vector>

namespace mapweave::exporters {

struct SessionTrajectory {
  SessionId session;
  std::vector<StampedPose> poses;  // by stamp
};

// Of every session that has poses of a robot, in id order; of a robot with a laser and cameras, those of the laser. The
// node of a map_server grid is none.
std::vector<SessionTrajectory> session_trajectories(const Map&);
// The poses of session_trajectories() of each robot, of all its sessions, by stamp.
std::map<RobotId, std::vector<StampedPose>> robot_trajectories(const Map&);

}  // namespace mapweave::exporters
