#include <mapweave/evaluation/grid_agreement.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::evaluation {
namespace {

enum class Cell : std::uint8_t { unknown = 0, free = 1, wall = 2 };  // pooling keeps the greatest

// A grid's classes on the common lattice; cell (0, 0) of the raster is cell (first_column, first_row) of the lattice.
struct Raster {
  std::int64_t first_column = 0, first_row = 0, columns = 0, rows = 0;
  std::vector<Cell> cells;
  Cell at(std::int64_t column, std::int64_t row) const {
    column -= first_column;
    row -= first_row;
    const bool inside = column >= 0 && row >= 0 && column < columns && row < rows;
    return inside ? cells[static_cast<std::size_t>(row * columns + column)] : Cell::unknown;
  }
  bool wall_near(std::int64_t column, std::int64_t row, int tolerance) const {
    for (std::int64_t r = row - tolerance; r <= row + tolerance; ++r)
      for (std::int64_t c = column - tolerance; c <= column + tolerance; ++c)
        if (at(c, r) == Cell::wall) return true;
    return false;
  }
};

Raster pooled(const OccupancyGrid& grid, const OccupancyGrid& lattice) {
  MAPWEAVE_EXPECT(!grid.empty() && grid.resolution_m > 0.0, "a grid without cells agrees with nothing");
  // The lattice's cell that holds the centre of one of the grid's. Centres on a border go up, without wavering.
  const auto column_of = [&](std::int32_t c) {
    return static_cast<std::int64_t>(std::floor(
        (grid.origin_x_m + (c + 0.5) * grid.resolution_m - lattice.origin_x_m) / lattice.resolution_m + 1e-6));
  };
  const auto row_of = [&](std::int32_t r) {
    return static_cast<std::int64_t>(std::floor(
        (grid.origin_y_m + (r + 0.5) * grid.resolution_m - lattice.origin_y_m) / lattice.resolution_m + 1e-6));
  };
  Raster raster;
  raster.first_column = column_of(0);
  raster.first_row = row_of(0);
  raster.columns = column_of(grid.columns - 1) - raster.first_column + 1;
  raster.rows = row_of(grid.rows - 1) - raster.first_row + 1;
  raster.cells.assign(static_cast<std::size_t>(raster.columns * raster.rows), Cell::unknown);
  for (std::int32_t row = 0; row < grid.rows; ++row) {
    const std::int64_t target_row = (row_of(row) - raster.first_row) * raster.columns;
    for (std::int32_t column = 0; column < grid.columns; ++column) {
      const std::int16_t log_odds = grid.at(column, row);
      const Cell cell = log_odds == OccupancyGrid::kUnknown ? Cell::unknown : log_odds > 0 ? Cell::wall : Cell::free;
      Cell& target = raster.cells[static_cast<std::size_t>(target_row + column_of(column) - raster.first_column)];
      target = std::max(target, cell);
    }
  }
  return raster;
}

struct Counts {
  std::size_t known = 0, common = 0, same = 0;   // cells of one grid; of them known to the other; of them alike
  std::size_t walls = 0, matched = 0;            // walls; of them with a wall of the other near
  std::size_t seen_walls = 0, contradicted = 0;  // walls that the other knows; of them free there with no wall near
};

Counts count(const Raster& one, const Raster& other, int tolerance) {
  Counts counts;
  for (std::int64_t row = one.first_row; row < one.first_row + one.rows; ++row)
    for (std::int64_t column = one.first_column; column < one.first_column + one.columns; ++column) {
      const Cell cell = one.at(column, row);
      if (cell == Cell::unknown) continue;
      const Cell there = other.at(column, row);
      ++counts.known;
      if (there != Cell::unknown) ++counts.common;
      if (there == cell) ++counts.same;
      if (cell != Cell::wall) continue;
      const bool near = other.wall_near(column, row, tolerance);
      ++counts.walls;
      if (near) ++counts.matched;
      if (there != Cell::unknown) ++counts.seen_walls;
      if (there == Cell::free && !near) ++counts.contradicted;
    }
  return counts;
}

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

GridAgreement grid_agreement(const OccupancyGrid& a, const OccupancyGrid& b, const GridAgreementOptions& options) {
  const auto order = [](const OccupancyGrid& grid) {
    return std::make_tuple(-grid.resolution_m, grid.origin_x_m, grid.origin_y_m);
  };
  const OccupancyGrid& lattice = order(b) < order(a) ? b : a;
  const Raster raster_a = pooled(a, lattice), raster_b = pooled(b, lattice);
  const Counts of_a = count(raster_a, raster_b, options.wall_tolerance_cells),
               of_b = count(raster_b, raster_a, options.wall_tolerance_cells);
  if (of_a.known == 0 || of_b.known == 0)
    throw Error(ErrorCode::kBadInput, "a grid without a single known cell cannot be compared");

  GridAgreement result;
  result.resolution_m = lattice.resolution_m;
  const double cell_m2 = lattice.resolution_m * lattice.resolution_m;
  result.known_a_m2 = static_cast<double>(of_a.known) * cell_m2;
  result.known_b_m2 = static_cast<double>(of_b.known) * cell_m2;
  result.common_m2 = static_cast<double>(of_a.common) * cell_m2;
  result.overlap = share(of_a.common, std::min(of_a.known, of_b.known));
  result.agreement = share(of_a.same, of_a.common);
  result.conflict = std::max(share(of_a.contradicted, of_a.seen_walls), share(of_b.contradicted, of_b.seen_walls));
  // Each matched wall is half of the intersection: its partner is the other half.
  const double intersection = 0.5 * static_cast<double>(of_a.matched + of_b.matched);
  const double walls = static_cast<double>(of_a.walls + of_b.walls);
  result.wall_iou = walls == 0.0 ? 0.0 : intersection / (walls - intersection);
  return result;
}

OccupancyGrid moved(const OccupancyGrid& grid, const Pose2& there_from_grid, double scale) {
  constexpr double kMostCells = 4e8;
  MAPWEAVE_EXPECT(!grid.empty() && scale > 0.0, "a grid without cells cannot be moved");
  const double width_m = grid.columns * grid.resolution_m, height_m = grid.rows * grid.resolution_m;
  double least_x = INFINITY, least_y = INFINITY, most_x = -INFINITY, most_y = -INFINITY;
  for (const double x : {grid.origin_x_m, grid.origin_x_m + width_m})
    for (const double y : {grid.origin_y_m, grid.origin_y_m + height_m}) {
      const Pose2 corner = compose(there_from_grid, Pose2(scale * x, scale * y, 0.0));
      least_x = std::min(least_x, corner.x);
      most_x = std::max(most_x, corner.x);
      least_y = std::min(least_y, corner.y);
      most_y = std::max(most_y, corner.y);
    }
  OccupancyGrid result;
  result.resolution_m = grid.resolution_m;
  result.origin_x_m = least_x;
  result.origin_y_m = least_y;
  const double columns = std::ceil((most_x - least_x) / grid.resolution_m - 1e-6),
               rows = std::ceil((most_y - least_y) / grid.resolution_m - 1e-6);
  if (!(columns * rows <= kMostCells))
    throw Error(ErrorCode::kBadInput, "a grid that is moved so would be too large", {}, "check the motion");
  result.columns = static_cast<std::int32_t>(columns);
  result.rows = static_cast<std::int32_t>(rows);
  result.log_odds.assign(static_cast<std::size_t>(columns * rows), OccupancyGrid::kUnknown);
  const Pose2 grid_from_there = inverse(there_from_grid);
  for (std::int32_t row = 0; row < result.rows; ++row)
    for (std::int32_t column = 0; column < result.columns; ++column) {
      const Pose2 centre = compose(grid_from_there, Pose2(least_x + (column + 0.5) * grid.resolution_m,
                                                          least_y + (row + 0.5) * grid.resolution_m, 0.0));
      const auto from_column =
          static_cast<std::int32_t>(std::floor((centre.x / scale - grid.origin_x_m) / grid.resolution_m + 1e-9));
      const auto from_row =
          static_cast<std::int32_t>(std::floor((centre.y / scale - grid.origin_y_m) / grid.resolution_m + 1e-9));
      if (grid.inside(from_column, from_row))
        result.log_odds[static_cast<std::size_t>(row) * static_cast<std::size_t>(result.columns) +
                        static_cast<std::size_t>(column)] = grid.at(from_column, from_row);
    }
  return result;
}

}  // namespace mapweave::evaluation
