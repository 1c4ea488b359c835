#pragma once
// Images of grids, in and out. Reading: hostile bytes until decoded.

#include <mapweave/maps/occupancy_grid.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::exporters {

constexpr std::uint8_t kFreeShade = 254, kWallShade = 0, kUnknownShade = 205;

// Row 0 is the top.
struct MapServerImage {
  std::int32_t columns = 0, rows = 0;
  std::vector<std::uint8_t> shades;  // 0 black, 255 white
  std::vector<bool> transparent;     // empty where the image has no such pixel
};

// The trinary picture of a grid, the highest y on top.
MapServerImage grey_image(const OccupancyGrid&);

// PGM (P2, P5) or PNG; colours are averaged, 16 bits become 8. Throws Error kCorrupt or kUnsupported.
MapServerImage decode_image(std::string_view bytes, const std::string& where);

}  // namespace mapweave::exporters
