#pragma once
// Trajectories as programs and data sets write them. The columns tell which form it is.

#include <mapweave/evaluation/trajectory.h>

#include <filesystem>
#include <string>
#include <string_view>

namespace mapweave::evaluation {

enum class TrajectoryFormat {
  tum,     // stamp x y z qx qy qz qw
  planar,  // stamp x y theta
  euroc,   // csv: stamp in nanoseconds, x, y, z, qw, qx, qy, qz, further columns
  kitti,   // a 3 x 4 matrix a line, row by row; stamps stand in a file of their own
};

struct TrajectoryFile {
  Trajectory trajectory;
  TrajectoryFormat format = TrajectoryFormat::tum;
  bool has_stamps = true;  // false: of KITTI without its times; the stamps are the numbers of the poses, in seconds
};

// `times`: of KITTI, a stamp in seconds a line; empty: none. Throws Error, with the line, for other columns, what is no
// finite number, stamps that do not increase, orientations that are none (within 0.01; smaller errors are normalised
// away), text without a pose, another number of times than of poses.
TrajectoryFile parse_trajectory(std::string_view text, const std::string& where, std::string_view times = {});

// Times of KITTI: `times_file`, or else times.txt or NAME.times.txt beside NAME.txt, or the data set's
// ../sequences/NAME/times.txt.
TrajectoryFile read_trajectory(const std::filesystem::path& file, const std::filesystem::path& times_file = {});

}  // namespace mapweave::evaluation
