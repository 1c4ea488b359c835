#pragma once
// A map seen from above, with what people need around it: title, legend, robots' trajectories and scale.

#include "drawing.h"

#include <mapweave/exporters/grid_image.h>

namespace mapweave::exporters {

struct MapRaster {
  cv::Mat pixels;                    // 8 bits, blue, green, red; the highest y on top
  double left_m = 0.0, low_m = 0.0;  // of the lower left pixel's corner, in the map
  double pixels_per_m = 1.0;
  std::string size;  // in words, beside the scale bar
};

std::string framed_map_png(const MapRaster&, const std::vector<SessionTrajectory>&, const PictureOptions&);

}  // namespace mapweave::exporters
