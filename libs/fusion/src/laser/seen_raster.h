#pragma once
// What one side of a comparison saw of a part of the plane, all its submaps together.

#include "wall_agreement.h"

#include <mapweave/maps/occupancy_grid.h>
#include <mapweave/matching/raster.h>

namespace mapweave::fusion {

struct PlaneBox {
  double x0_m = 1e300, y0_m = 1e300, x1_m = -1e300, y1_m = -1e300;
  bool empty() const { return x0_m >= x1_m || y0_m >= y1_m; }
  bool has(double x, double y) const { return x >= x0_m && x < x1_m && y >= y0_m && y < y1_m; }
  void add(double x, double y, double around_m);
  PlaneBox within(const PlaneBox& other) const;
  PlaneBox grown(double by_m) const { return {x0_m - by_m, y0_m - by_m, x1_m + by_m, y1_m + by_m}; }
};

// Around all walls.
PlaneBox box_of(const std::vector<PlacedSubmap>& side);

// Walls in the box, one a cell of the raster's size, team frame.
std::vector<matching::WallPoint> walls_in(const std::vector<PlacedSubmap>& side, const PlaneBox& box);

// Cells of the team's frame.
class SeenRaster {
 public:
  static constexpr double kCell_m = 0.1;
  SeenRaster(const std::vector<PlacedSubmap>& side, const PlaneBox& box, const SightOf& sight_of);
  Seen at(double x, double y) const {
    return at_cell(matching::cell_of(x, 1.0 / kCell_m), matching::cell_of(y, 1.0 / kCell_m));
  }
  Seen at_cell(int x, int y) const { return cells_.get(x, y); }
  // Cells of twice the size that hold a wall or lie beside one that does.
  matching::Raster<char> walls_about() const;
  // In the same frame.
  OccupancyGrid grid() const;

 private:
  matching::Raster<Seen> cells_;
};

}  // namespace mapweave::fusion
