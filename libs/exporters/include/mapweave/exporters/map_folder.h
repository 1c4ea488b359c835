#pragma once
// What one folder of `mapweave slam`, `run`, `merge` or `export` holds of a map, beside map.mwdb.

#include <mapweave/exporters/grid_image.h>
#include <mapweave/exporters/point_cloud.h>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::exporters {

struct MapFolderFiles {
  bool png = true;                 // map.png, map.color.png
  bool pgm = true;                 // map.pgm, map.yaml
  bool pcd = true;                 // map.pcd
  bool tum = true;                 // trajectory.tum
  bool robot_trajectories = false; // trajectories/<robot>.tum: for a team's folder
  bool g2o = false;                // map.g2o
};

struct MapFolderOptions {
  MapFolderFiles files;
  PictureOptions picture;
  PointCloudOptions cloud;
};

// Writes the files asked for into `folder`, which it creates, and returns their names relative to it, in that order. A grid without cells (a
// map that saw nothing) has no png and no pgm. Throws Error(kCannotWrite).
std::vector<std::filesystem::path> write_map_folder(const std::filesystem::path& folder, const Map&, const OccupancyGrid&, const MapFolderOptions& = {});

}  // namespace mapweave::exporters
