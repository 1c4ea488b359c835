#pragma once
// What aligning two occupancy grids needs of each: faces of walls and how deep in free space a place lies. Grids of
// other makers come in any resolution; here all are brought to about the same.

#include <mapweave/maps/occupancy_grid.h>
#include <mapweave/matching/wall_point.h>

#include <vector>

namespace mapweave::matching {

struct GridWalls {
  double cell_m = 0.0;  // of the depths below, and between faces: 0.1 m, or what keeps the grid below 2048 cells across
  double origin_x_m = 0.0, origin_y_m = 0.0;  // lower-left corner of the known part, in the grid's frame
  int columns = 0, rows = 0;                  // of the known part
  std::vector<WallPoint> faces;               // in the grid's frame, about one a cell of wall; normals to the free side
  std::vector<float> depth_m;  // of each cell: distance to the next that is not free; 0 where the cell is not free

  float depth_at(double x_m, double y_m) const {  // 0 outside
    const double column = (x_m - origin_x_m) / cell_m, row = (y_m - origin_y_m) / cell_m;
    if (column < 0.0 || row < 0.0 || column >= columns || row >= rows) return 0.0F;
    return depth_m[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                   static_cast<std::size_t>(column)];
  }
  double wall_m() const { return static_cast<double>(faces.size()) * cell_m; }
};

// Time and memory grow with the grid's cells once (a pass over them); all else is bounded by 2048 x 2048 cells.
GridWalls walls_of(const OccupancyGrid&);

// The same place seen in a mirror: x negated.
GridWalls mirrored(const GridWalls&);

}  // namespace mapweave::matching
