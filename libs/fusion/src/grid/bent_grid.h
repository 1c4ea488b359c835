#pragma once
// Grids of real buildings are bent by decimetres to metres. Here one is laid on another as a mesh of tiles: each tile
// is registered to the walls around it, neighbours hold each other as firmly as real grids do, and a pose graph
// decides.

#include "face_index.h"
#include "grid_stiffness.h"

#include <mapweave/matching/grid_proposals.h>

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace mapweave::fusion {

// A grid ready to be compared with others.
struct PreparedGrid {
  explicit PreparedGrid(matching::GridWalls grid_walls);
  matching::GridWalls walls;
  FaceIndex index;
  std::vector<matching::WallPoint> samples;  // of the faces, evenly spread, at most 8,000
  double sample_m = 0.0;                     // length of wall that a sample stands for
  // The mesh: tiles of 5 m, or what keeps it below 32 tiles across; where something is known.
  double tile_m = 0.0;
  int columns = 0, rows = 0;
  std::vector<int> tile_number;               // by row and column; -1: none
  std::vector<Eigen::Vector2d> tile_centres;  // in the grid's frame
  std::vector<std::pair<int, int>> neighbours;

  int tile_at(double x_m, double y_m) const;  // -1: none
};

struct BentGrid {
  matching::PlanarSimilarity a_from_b;  // before bending
  std::vector<Pose2> a_from_tile;       // of each tile of b: its centre and rotation
  // What holds each tile in a: x, y, yaw in the tile's frame; 1/m^2, 1/rad^2. Rank-deficient where its walls leave it
  // free to slide.
  std::vector<Eigen::Matrix3d> information;
  double chi2 = 0.0;  // of the bends
};

// Lays b's walls on a's as one rigid piece that may grow, from an alignment that is at most 1.5 m off.
matching::PlanarSimilarity refined(const PreparedGrid& a, const PreparedGrid& b, matching::PlanarSimilarity a_from_b,
                                   double scale_range);
BentGrid bent(const PreparedGrid& a, const PreparedGrid& b, const matching::PlanarSimilarity& a_from_b);

// A face of b as it lies in a, and the other way round, where b has a tile.
matching::WallPoint in_a(const PreparedGrid& b, const BentGrid& bend, int tile, const matching::WallPoint& face_in_b);
std::optional<matching::WallPoint> in_b(const PreparedGrid& b, const BentGrid& bend,
                                        const matching::WallPoint& face_in_a);

}  // namespace mapweave::fusion
