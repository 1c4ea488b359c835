#pragma once
// Planar numbers rounded to floats: an update with MapUpdate::in_floats writes them in half of the bytes. At 100 m from
// a map's origin a position moves by 4 micrometres at most.

#include <mapweave/maps/map.h>

namespace mapweave {

double in_float(double);  // the nearest number that a float holds
Pose2 in_floats(const Pose2&);
Pose3 in_floats(const Pose3& planar_pose);
// Symmetric and not negative, as the information was: the diagonal grows by a millionth.
Eigen::Matrix3d in_floats(const Eigen::Matrix3d& information);

}  // namespace mapweave
