#pragma once
// A raster that somebody else drew (a map_server file) as a map that can be fused: cut into tiles, each a node with its
// piece as content, and overlapping submaps of tiles.

#include <mapweave/maps/map.h>

#include <map>

namespace mapweave::fusion {

// Session: robot named as the map, sensor "grid", run 0. The map's frame is the grid's. Throws Error(kBadInput) where
// every cell is unknown.
Map map_of_grid(MapId id, const OccupancyGrid& grid);

bool is_grid(const Map&);
// Such a map rescaled by `scale`, its cells too.
Map rescaled_grid(const Map&, double scale);
// Where the tiles of such a map lay before anything bent it: the first as believed, the others by what holds them.
std::map<NodeId, Pose2> unbent_tiles(const Map&);
// The grid that such a map was made of, cut down to its tiles; empty where nodes are no tiles or were turned.
OccupancyGrid grid_of_map(const Map&);

}  // namespace mapweave::fusion
