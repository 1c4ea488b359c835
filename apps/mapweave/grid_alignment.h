#pragma once
// How one grid lies in the frame of another one.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/occupancy_grid.h>

#include <string>

namespace mapweave::app {

struct GridAlignment {
  Pose2 a_from_b;
  double scale = 1.0;  // of b's lengths in a's
};

// By "none", "X,Y,YAW", or "auto": as `merge` would lay them on each other. Throws Error: kUsage for other text,
// kBadInput where no place is found at which they fit.
GridAlignment grid_alignment(const std::string& text, const OccupancyGrid& a, const OccupancyGrid& b);

}  // namespace mapweave::app
