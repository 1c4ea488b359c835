#pragma once
// The ways that a map's robots went.

#include <mapweave/maps/map.h>

#include <optional>
#include <vector>

namespace mapweave::exporters {

struct StampedPose {
  Stamp stamp;
  Pose3 map_from_robot;
};

struct SessionTrajectory {
  SessionId session;
  std::vector<StampedPose> poses;  // by stamp
};

// Of every session that has poses of a robot, in id order; of a robot with a laser and cameras, those of the laser. The node of a
// map_server grid is none.
std::vector<SessionTrajectory> session_trajectories(const Map&);

// Between two poses (by stamp), at most `longest_gap_s` apart; nullopt before the first, after the last and in longer gaps.
std::optional<Pose3> pose_at(const std::vector<StampedPose>&, Stamp, double longest_gap_s);

}  // namespace mapweave::exporters
