#include <mapweave/core/disjoint_sets.h>
#include <mapweave/core/format.h>
#include <mapweave/fusion/raster_doubt.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::fusion {
namespace {

// A raster brought to cells of 0.1 m, or what keeps it below 2048 cells across.
class Coarse {
 public:
  explicit Coarse(const OccupancyGrid& grid) {
    constexpr double kCell_m = 0.1;   // as fine as walls are thick
    constexpr int kMostCells = 2048;  // across: bounds time and memory
    const int side = std::max(grid.columns, grid.rows);
    stride_ =
        std::max({1, static_cast<int>(std::lround(kCell_m / grid.resolution_m)), (side + kMostCells - 1) / kMostCells});
    cell_m = stride_ * grid.resolution_m;
    columns = (grid.columns + stride_ - 1) / stride_;
    rows = (grid.rows + stride_ - 1) / stride_;
    cells_.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0);
    for (std::int32_t row = 0; row < grid.rows; ++row)
      for (std::int32_t column = 0; column < grid.columns; ++column)
        if (const std::int16_t value = grid.at(column, row); value != OccupancyGrid::kUnknown) {
          char& cell = cells_[place(column / stride_, row / stride_)];
          cell = static_cast<char>(cell | (value > OccupancyGrid::kUnknown ? kWall : kFree));
        }
  }

  bool is_wall(int column, int row) const {
    return is_inside(column, row) && (cells_[place(column, row)] & kWall) != 0;
  }
  bool is_free(int column, int row) const { return is_inside(column, row) && cells_[place(column, row)] == kFree; }
  bool is_face(int column, int row) const {
    return is_wall(column, row) && (is_free(column - 1, row) || is_free(column + 1, row) || is_free(column, row - 1) ||
                                    is_free(column, row + 1));
  }
  std::size_t place(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(column);
  }

  double cell_m = 0.0;
  int columns = 0, rows = 0;

 private:
  static constexpr char kWall = 1, kFree = 2;
  bool is_inside(int column, int row) const { return column >= 0 && row >= 0 && column < columns && row < rows; }
  int stride_ = 1;
  std::vector<char> cells_;
};

struct Piece {
  int left, low, right, high;
  std::size_t faces = 0;
};

// Walls that hang together.
std::vector<Piece> pieces_of(const Coarse& raster) {
  DisjointSets together(static_cast<std::size_t>(raster.columns) * static_cast<std::size_t>(raster.rows));
  for (int row = 0; row < raster.rows; ++row)
    for (int column = 0; column < raster.columns; ++column) {
      if (!raster.is_wall(column, row)) continue;
      if (raster.is_wall(column - 1, row)) together.join(raster.place(column - 1, row), raster.place(column, row));
      for (int i = -1; i <= 1; ++i)
        if (raster.is_wall(column + i, row - 1))
          together.join(raster.place(column + i, row - 1), raster.place(column, row));
    }
  std::map<std::size_t, Piece> pieces;
  for (int row = 0; row < raster.rows; ++row)
    for (int column = 0; column < raster.columns; ++column) {
      if (!raster.is_wall(column, row)) continue;
      Piece& piece =
          pieces.emplace(together.find(raster.place(column, row)), Piece{column, row, column, row}).first->second;
      piece.left = std::min(piece.left, column);
      piece.right = std::max(piece.right, column);
      piece.high = row;
      piece.faces += raster.is_face(column, row);
    }
  std::vector<Piece> result;
  for (const auto& entry : pieces) result.push_back(entry.second);
  return result;
}

}  // namespace

// Of 20 grids of robots and floor plans at least 95 % of the walls hang together over 2 m; up to 15 % of what is known
// is wall, 0.1 to 0.5 m thick. Of pages of text at most 20 % do so, until letters are as large as rooms; in photographs
// from 40 % on is wall, or it is 1 m thick. The bounds lie between these; a grid below the first two shows nothing yet.
std::string doubt_of_raster(const OccupancyGrid& grid) {
  constexpr double kLeastFree_m2 = 1.0, kLeastWall_m = 2.0, kPiece_m = 2.0, kLeastInPieces = 0.5, kMostWall = 0.4,
                   kThickest_m = 0.8;
  if (grid.empty()) return "";
  const Coarse raster(grid);
  std::size_t walls = 0, free = 0, faces = 0, in_pieces = 0;
  for (int row = 0; row < raster.rows; ++row)
    for (int column = 0; column < raster.columns; ++column) {
      walls += raster.is_wall(column, row);
      free += raster.is_free(column, row);
      faces += raster.is_face(column, row);
    }
  const double cell_m = raster.cell_m, wall_m = static_cast<double>(faces) * cell_m;
  if (static_cast<double>(free) * cell_m * cell_m < kLeastFree_m2) return "shows no free space";
  if (wall_m < kLeastWall_m) return format("shows %.1f m of wall beside free space", wall_m);
  const double share = static_cast<double>(walls) / static_cast<double>(walls + free);
  const double thick_m = static_cast<double>(walls) * cell_m / static_cast<double>(faces);
  if (share > kMostWall || thick_m > kThickest_m)
    return format("looks like no map: %.0f %% of it is wall, %.1f m thick on average, as in a photograph",
                  100.0 * share, thick_m);
  for (const Piece& piece : pieces_of(raster))
    if (std::hypot(piece.right - piece.left, piece.high - piece.low) * cell_m >= kPiece_m) in_pieces += piece.faces;
  const double hanging = static_cast<double>(in_pieces) / static_cast<double>(faces);
  if (hanging < kLeastInPieces)
    return format("looks like no map: %.0f %% of its walls are pieces shorter than %.0f m, as on a page of text",
                  100.0 * (1.0 - hanging), kPiece_m);
  return "";
}

}  // namespace mapweave::fusion
