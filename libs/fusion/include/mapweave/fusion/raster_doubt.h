#pragma once
// Whether a raster of another maker can be a map of walls and free space at all.

#include <mapweave/maps/occupancy_grid.h>

#include <string>

namespace mapweave::fusion {

// What is odd about it, to stand after its name; empty where nothing is. Words alone: nothing is decided by them.
std::string doubt_of_raster(const OccupancyGrid& grid);

}  // namespace mapweave::fusion
