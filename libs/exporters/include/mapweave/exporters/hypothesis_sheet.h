#pragma once
// Hypotheses of how two maps lie to each other, side by side.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/occupancy_grid.h>

#include <string>
#include <vector>

namespace mapweave::exporters {

struct HypothesisPanel {
  Pose2 a_from_b;
  double scale = 1.0;                // of b's map in a's
  std::vector<std::string> caption;  // lines below the picture; too long ones are wrapped
  struct Ring {
    double x_m = 0.0, y_m = 0.0, radius_m = 0.5;  // a's frame
  };
  // Where walls were seen through. Red are there, and nowhere else, walls that the other map has free floor at and no
  // wall beside: what is painted is what was counted.
  std::vector<Ring> rings;
};

// PNG, a panel each: walls of `a` blue, of `b` orange, of both dark, and red what was seen through, in the rings.
// `a_name`, `b_name` stand in the legend. Contract: there are panels, and both grids have cells.
std::string hypothesis_sheet_png(const OccupancyGrid& a, const OccupancyGrid& b,
                                 const std::vector<HypothesisPanel>& panels, const std::string& title,
                                 const std::string& a_name, const std::string& b_name);

}  // namespace mapweave::exporters
