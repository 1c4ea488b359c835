#pragma once
// Cells of a MapSummary as points of its frame.

#include <mapweave/maps/map_summary.h>

#include <cmath>
#include <vector>

namespace mapweave::scheduling {

struct CellPoint {
  double x, y;
};

inline std::int32_t cell_of(double metres) {
  return static_cast<std::int32_t>(std::floor(metres / MapSummary::kCell_m));
}

// Middles of the cells that are walls, row by row.
inline std::vector<CellPoint> walls_of(const MapSummary& summary) {
  std::vector<CellPoint> walls;
  for (std::int32_t row = summary.bottom; row < summary.bottom + summary.rows; ++row)
    for (std::int32_t column = summary.left; column < summary.left + summary.columns; ++column)
      if (summary.at(column, row) == MapSummary::Cell::wall)
        walls.push_back({(column + 0.5) * MapSummary::kCell_m, (row + 0.5) * MapSummary::kCell_m});
  return walls;
}

}  // namespace mapweave::scheduling
