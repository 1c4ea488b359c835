#pragma once
// Trajectories as text in the form of the TUM RGB-D benchmark, which evo and others read: `stamp x y z qx qy qz qw` a
// line, the robot's pose in the map, one line per scan, stamps in seconds and strictly increasing, everything with 6
// decimals.

#include <mapweave/exporters/session_trajectories.h>

#include <string>

namespace mapweave::exporters {

// All robots of the map. Of scans with one stamp (to the microsecond) the one of the lower RobotId stays, of one
// robot's that of the lower NodeId.
std::string tum_text(const Map&);

// One robot's. Empty where the map does not hold it.
std::string tum_text(const Map&, RobotId);

// Of poses that no map holds: cameras' frames, by stamp.
std::string tum_text(const std::vector<SessionTrajectory>&);
std::string tum_text(const std::vector<StampedPose>&);

}  // namespace mapweave::exporters
