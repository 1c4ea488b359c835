#pragma once
// What a coordinator needs to know of a map to estimate what it shares with others (RecSLAM V, "Parameter profiling"):
// some hundred bytes for a floor, whatever the map holds.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace mapweave {

// Seen from above, in cells of a quarter of a metre.
struct MapSummary {
  static constexpr double kCell_m = 0.25;
  static constexpr std::int64_t kMostCells = 1 << 22;  // a quarter of a square kilometre
  static constexpr std::size_t kMostLooks = 64;
  enum class Cell : std::uint8_t { unknown = 0, free = 1, wall = 2 };
  // How the place looks around a point of the robot's path: walls by ring of distance. Does not change with heading.
  struct Look {
    static constexpr int kRings = 14;
    static constexpr double kRing_m = 0.75;
    std::int32_t x_cm = 0, y_cm = 0;
    std::array<std::uint8_t, kRings> walls{};
  };

  // Cell (column, row) covers [(left + column) kCell_m, ... + kCell_m), row 0 the lowest.
  std::int32_t left = 0, bottom = 0, columns = 0, rows = 0;
  std::vector<Cell> cells;  // row by row
  std::vector<Look> looks;
  bool is_in_team_frame = false;  // else in the map's own, of which nobody knows how it lies in others'

  std::size_t known() const {  // cells
    std::size_t count = 0;
    for (const Cell cell : cells) count += cell != Cell::unknown;
    return count;
  }
  Cell at(std::int64_t column, std::int64_t row) const {  // counted as left and bottom are
    column -= left;
    row -= bottom;
    if (column < 0 || row < 0 || column >= columns || row >= rows) return Cell::unknown;
    return cells[static_cast<std::size_t>(row * columns + column)];
  }
};

}  // namespace mapweave
