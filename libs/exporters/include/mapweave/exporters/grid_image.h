#pragma once
// Pictures of a map (PNG): the plain grid for machines, and a drawn one for people.

#include <mapweave/exporters/session_trajectories.h>
#include <mapweave/maps/occupancy_grid.h>

#include <string>
#include <vector>

namespace mapweave::exporters {

// One grey pixel per cell, the highest y on top: 254 free, 0 wall, 205 unknown. Contract: the grid has cells.
std::string grid_png(const OccupancyGrid&);

struct PictureOptions {
  std::string title;          // above the map; may be empty; its writer's to choose, no option of users
  int least_width_px = 900;   // small maps are enlarged, cells staying square
  int common_side_px = 1600;  // the longer side of the map is enlarged to about this
  int most_side_px = 4000;    // large ones are thinned until their longer side is below; walls stay
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("least_width_px", least_width_px, 300, 4000,
              "least width in pixels of map.color.png; narrower maps get margins, so that title and legend fit; larger "
              "values make wider margins");
    v.integer("common_side_px", common_side_px, 100, 4000,
              "length in pixels to which the longer side of a small map is enlarged in map.color.png, by a whole "
              "number of pixels per cell; larger values make larger pictures");
    v.integer("most_side_px", most_side_px, 500, 20000,
              "length in pixels that the longer side of a large map does not exceed in map.color.png; several cells "
              "become one pixel; larger values make larger pictures");
  }
};

// A place that a picture points at with a red ring.
struct PictureMark {
  double x_m = 0.0, y_m = 0.0, radius_m = 0.0;  // in the map's frame; small ones are drawn large enough to be seen
};

// The known part of the grid (single rays that leave it are cut off) with each robot's trajectory in its colour
// (colour-blind-safe up to 8 robots; names stand by the starts), start (ring) and end (square), a legend and a scale
// bar. The colour of a robot follows from its place among the RobotIds present. Contract: the grid has cells.
std::string map_picture_png(const OccupancyGrid&, const std::vector<SessionTrajectory>&, const PictureOptions& = {},
                            const std::vector<PictureMark>& marks = {});

}  // namespace mapweave::exporters
