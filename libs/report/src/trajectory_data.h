#pragma once

#include "encoding.h"

#include <mapweave/evaluation/trajectory.h>

namespace mapweave::report {

// At most `most` poses of it, evenly picked, the first and the last among them; times and places as differences in
// whole milliseconds, millimetres and milliradians. Contract: it has a pose, and most > 1.
Json trajectory_json(const evaluation::Trajectory&, std::size_t most);

}  // namespace mapweave::report
