#pragma once
// What one folder of `mapweave slam`, `run`, `merge` or `export` holds of a map, beside map.mwdb.

#include <mapweave/exporters/grid_image.h>
#include <mapweave/exporters/point_cloud.h>
#include <mapweave/maps/map_identity.h>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::exporters {

struct MapFolderFiles {
  bool png = true;                  // map.png, map.color.png
  bool pgm = true;                  // map.pgm, map.yaml
  bool pcd = true;                  // map.pcd
  bool tum = true;                  // trajectory.tum of a robot, trajectories/<robot>.tum of each of several
  bool robot_trajectories = false;  // a single robot's in trajectories/ as well: a team's folder
  bool g2o = false;                 // map.g2o
  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("png", png, "write map.png, and map.color.png with the trajectories");
    v.flag("pgm", pgm, "write map.pgm and map.yaml, the occupancy grid as ROS's map_server and nav2 load it");
    v.flag("pcd", pcd, "write map.pcd, the laser's wall points as a point cloud");
    v.flag("tum", tum,
           "write trajectory.tum, the trajectory in TUM format; of several robots trajectories/<robot>.tum");
    v.flag("g2o", g2o, "write map.g2o, the pose graph");
  }
};

struct MapFolderOptions {
  MapFolderFiles files;
  PictureOptions picture;
  PointCloudOptions cloud;
  MapIdentity identity = {};  // for map.yaml
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("files", files, "which files a map's folder holds");
    v.section("picture", picture, "the drawn map, map.color.png");
    v.section("cloud", cloud, "the walls as points, map.pcd");
  }
};

// Writes the files asked for into `folder`, which it creates, and returns their names relative to it, in that order. A
// map whose grid has no cells has no pgm, and for png its landmarks from above, where it has any; a trajectory is
// written of robots that have poses. Throws Error(kCannotWrite).
std::vector<std::filesystem::path> write_map_folder(const std::filesystem::path& folder, const Map&,
                                                    const OccupancyGrid&, const MapFolderOptions& = {});

}  // namespace mapweave::exporters
