#pragma once
// Hypotheses of how two maps lie to each other, side by side.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/occupancy_grid.h>

#include <string>
#include <vector>

namespace mapweave::exporters {

struct HypothesisPanel {
  Pose2 a_from_b;
  std::vector<std::string> caption;  // lines below the picture
  struct Ring {
    double x_m = 0.0, y_m = 0.0, radius_m = 0.5;  // a's frame
  };
  std::vector<Ring> rings;  // places to look at
};

// PNG, a panel each: walls of `a` blue, of `b` orange, of both dark, and red where one has a wall and the other saw free floor all around.
// `a_name`, `b_name` stand in the legend. Contract: there are panels, and both grids have cells.
std::string hypothesis_sheet_png(const OccupancyGrid& a, const OccupancyGrid& b, const std::vector<HypothesisPanel>& panels,
                                 const std::string& title, const std::string& a_name, const std::string& b_name);

}  // namespace mapweave::exporters
