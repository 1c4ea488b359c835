#pragma once
// A grid as pictures of the page: one to see it whole, and a finer one to look closer.

#include "encoding.h"

#include <mapweave/maps/occupancy_grid.h>

namespace mapweave::report {

struct GridDetail {
  int coarse_px, fine_px;  // longest sides; large grids are thinned by whole cells, and a wall wins
};

struct DrawnGrid {
  Json json;                            // resolution_m, levels: coarse first, then fine where that shows more
  double low_x, low_y, high_x, high_y;  // metres: where nearly all of what is known lies
};

// Contract: the grid has known cells.
DrawnGrid drawn_grid(const OccupancyGrid&, const GridDetail&);

bool has_known_cells(const OccupancyGrid&);

}  // namespace mapweave::report
