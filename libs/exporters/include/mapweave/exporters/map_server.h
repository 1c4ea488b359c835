#pragma once
// Occupancy grids as ROS keeps them: an image and a YAML file, for map_server and nav2, and from them.

#include <mapweave/maps/map_identity.h>
#include <mapweave/maps/occupancy_grid.h>

#include <filesystem>
#include <map>
#include <string>

namespace mapweave::exporters {

// Binary PGM: 0 wall, 254 free, 205 unknown; the highest y on top. Contract: the grid has cells.
std::string pgm_bytes(const OccupancyGrid&);

// What goes beside the image: mode trinary, origin of the lower-left pixel, yaw 0, occupied_thresh 0.65, free_thresh
// 0.196; of a map that has an identity map_id, map_version and content_hash, which map_server and nav2 pass over.
std::string map_server_yaml(const OccupancyGrid&, const std::string& image_name, const MapIdentity& = {});

// Writes <stem>.pgm, then <stem>.yaml beside it.
void write_map_server(const OccupancyGrid&, const std::filesystem::path& folder, const std::string& stem,
                      const MapIdentity& = {});

// Reads a map by its YAML file; needs `image` (PGM or PNG; relative to the YAML file) and `resolution`, the other keys
// default to what map_server_yaml writes. As nav2 does: modes trinary, scale (transparent pixels are unknown) and raw
// (0..100, `negate` not asked), colours averaged. Walls and free cells get log odds of +-kServedLogOdds, shades between
// the thresholds of `scale` and `raw` theirs. Where `origin` has a yaw, the grid is resampled along the axes of the
// map, each cell taking the pixel under its centre. Throws Error: kMissing for an absent file or key, kCorrupt for an
// image cut short or with a wrong size, kUnsupported for another format, kBadInput for numbers that make no map; with
// file, line and remedy.
OccupancyGrid read_map_server(const std::filesystem::path& yaml_file);
// The image that a YAML file names. Throws what reading the file throws.
std::filesystem::path image_of_map_server(const std::filesystem::path& yaml_file);
// map_id, map_version and content_hash, as far as the description has them: what this program wrote. Throws as above.
std::map<std::string, std::string> identity_of_map_server(const std::filesystem::path& yaml_file);

// A cell as nav_msgs/OccupancyGrid has it: 100 wall, 0 free, -1 unknown.
constexpr std::int8_t served_occupancy(std::int16_t log_odds) {
  return static_cast<std::int8_t>(log_odds > 0 ? 100 : log_odds < 0 ? 0 : -1);
}

constexpr std::int16_t kServedLogOdds = 300;  // a probability of 0.95

}  // namespace mapweave::exporters
