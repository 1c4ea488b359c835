#pragma once
// How far two occupancy grids of one frame say the same.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/occupancy_grid.h>

namespace mapweave::evaluation {

struct GridAgreementOptions {
  int wall_tolerance_cells = 1;  // a wall this near (in either axis) is the same wall
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("wall_tolerance_cells", wall_tolerance_cells, 0, 20,
              "distance in cells, along x and along y, at which two walls are the same wall; larger values let more "
              "walls agree");
  }
};

// All in cells of a common lattice: that of the coarser grid, into which the other is pooled (a cell is wall where any
// of its parts is wall, else free where any is free).
struct GridAgreement {
  double resolution_m = 0.0;  // of the lattice
  double known_a_m2 = 0.0, known_b_m2 = 0.0, common_m2 = 0.0;
  double overlap = 0.0;    // |A and B| / min(|A|, |B|) in known cells, 0..1
  double agreement = 0.0;  // share of the cells known to both that are wall in both or free in both; 0 without any
  double conflict =
      0.0;  // of the walls of one that the other knows, the share that is free there with no wall near; the higher side
  double wall_iou = 0.0;  // intersection over union of walls, near ones being the same; over all walls of both
};

// Symmetric in its grids. Throws Error(kBadInput) where a grid has no known cell.
GridAgreement grid_agreement(const OccupancyGrid& a, const OccupancyGrid& b, const GridAgreementOptions& = {});

// A grid in another frame: a point of the grid, times `scale`, lies there by `there_from_grid`. Each cell takes the one
// under its centre; the cells keep their size. Throws Error(kBadInput) where it would have more than 4e8 cells.
OccupancyGrid moved(const OccupancyGrid&, const Pose2& there_from_grid, double scale = 1.0);

}  // namespace mapweave::evaluation
