#pragma once
// A raster that somebody else drew (a map_server file) as a map that can be fused: cut into tiles, each a node with its piece as content,
// and overlapping submaps of tiles.

#include <mapweave/maps/map.h>

namespace mapweave::fusion {

// Session: robot named as the map, sensor "grid", run 0. The map's frame is the grid's. Throws Error(kBadInput) where every cell is
// unknown.
Map map_of_grid(MapId id, const OccupancyGrid& grid);

}  // namespace mapweave::fusion
