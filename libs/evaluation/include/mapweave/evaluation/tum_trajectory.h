#pragma once
// Reads trajectories in the form of the TUM RGB-D benchmark: `stamp x y z qx qy qz qw` a line, `#` starts a comment.
// They are written by exporters/trajectory_files.h.

#include <mapweave/evaluation/trajectory.h>

#include <filesystem>
#include <string>
#include <string_view>

namespace mapweave::evaluation {

// Throws Error, with the line, for another number of columns, what is no finite number, stamps that do not increase,
// quaternions whose length is not 1 within 0.01 (shorter rounding errors are normalised away), and for text without a
// single pose. `where`: the file's name, for messages.
Trajectory parse_tum(std::string_view text, const std::string& where);

Trajectory read_tum(const std::filesystem::path&);

}  // namespace mapweave::evaluation
