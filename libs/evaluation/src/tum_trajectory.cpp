#include <mapweave/evaluation/tum_trajectory.h>

#include "number_lines.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>

namespace mapweave::evaluation {

Trajectory parse_tum(std::string_view text, const std::string& where) {
  NumberLines lines(text, where, "stamp x y z qx qy qz qw");
  Trajectory trajectory;
  while (lines.next()) {
    TrajectoryPoint point;
    point.stamp = lines.stamp(0);
    point.pose.t = {lines.number(1), lines.number(2), lines.number(3)};
    point.pose.q = unit_quaternion({lines.number(7), lines.number(4), lines.number(5), lines.number(6)}, lines,
                                   "the columns are stamp x y z qx qy qz qw: the real part comes last");
    if (!trajectory.empty() && !(trajectory.back().stamp < point.stamp))
      lines.fail("the stamp is not later than that of the pose before it", "sort the file by stamp, one pose a stamp");
    trajectory.push_back(point);
  }
  if (trajectory.empty())
    throw Error(ErrorCode::kBadInput, "no pose in it; expected lines of stamp x y z qx qy qz qw", where);
  return trajectory;
}

Trajectory read_tum(const std::filesystem::path& path) { return parse_tum(read_file(path), path.string()); }

}  // namespace mapweave::evaluation
