#pragma once
// A raster of what is wall and what is free: always a cache of content under a belief, except where a raster is all
// that is known of a place (a map_server file): then it is a node's payload.

#include <mapweave/core/geometry.h>

#include <cstdint>
#include <vector>

namespace mapweave {

// Row 0 is the lowest y; cell (column, row) covers [origin + column * resolution, ... + resolution).
struct OccupancyGrid {
  static constexpr std::int16_t kUnknown = 0;
  static constexpr double kUnitsPerNat = 100.0;  // log odds of occupancy are stored times this

  double resolution_m = 0.05;
  double origin_x_m = 0.0, origin_y_m = 0.0;  // the lower-left corner of cell (0, 0) in the grid's frame
  std::int32_t columns = 0, rows = 0;
  std::vector<std::int16_t> log_odds;  // columns * rows, row by row; kUnknown, else > 0 occupied, < 0 free

  bool empty() const { return columns == 0 || rows == 0; }
  std::int16_t at(std::int32_t column, std::int32_t row) const {
    return log_odds[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                    static_cast<std::size_t>(column)];
  }
  bool inside(std::int32_t column, std::int32_t row) const {
    return column >= 0 && row >= 0 && column < columns && row < rows;
  }
};

double probability(std::int16_t log_odds);  // 0..1; 0.5 for unknown

}  // namespace mapweave
