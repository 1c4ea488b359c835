#pragma once
// Trajectories as text in the form of the TUM RGB-D benchmark, which evo and others read: `stamp x y z qx qy qz qw` a
// line, one robot's pose in the map, one line per scan, stamps in seconds and strictly increasing, everything with 6
// decimals.

#include <mapweave/core/stamped_pose.h>
#include <mapweave/maps/map.h>

#include <string>

namespace mapweave::exporters {

// One robot's; of scans with one stamp (to the microsecond) that of the lower NodeId stays. Empty where the map does
// not hold the robot.
std::string tum_text(const Map&, RobotId);

// Of poses that no map holds: cameras' frames, in any order.
std::string tum_text(const std::vector<StampedPose>&);

// Other forms of the same, sorted by stamp. KITTI: a 3 x 4 matrix a line, row by row, whose stamps (seconds a line)
// stand in a file of their own. EuRoC: csv with a header, nanoseconds first and the quaternion's real part before its
// others.
std::string kitti_text(const std::vector<StampedPose>&);
std::string kitti_times_text(const std::vector<StampedPose>&);
std::string euroc_text(const std::vector<StampedPose>&);

}  // namespace mapweave::exporters
