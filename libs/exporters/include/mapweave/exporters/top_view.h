#pragma once
// Landmarks of cameras, seen from above.

#include <mapweave/exporters/grid_image.h>
#include <mapweave/exporters/point_cloud.h>

namespace mapweave::exporters {

// PNG: each point a dot of its colour, higher ones above lower ones; what hangs well above the robots (ceilings) and
// single points far off are left out. `grid`: what lasers saw of the same map, below the dots (walls dark, floor white,
// what nobody saw grey); null or empty: none. Trajectories, legend and scale as in map_picture_png(). Contract: there
// are points or poses, all finite.
std::string top_view_png(const std::vector<ColouredPoint>&, const std::vector<SessionTrajectory>&,
                         const PictureOptions& = {}, const OccupancyGrid* grid = nullptr);

}  // namespace mapweave::exporters
