#include <mapweave/exporters/map_folder.h>

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/exporters/g2o_file.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/exporters/trajectory_files.h>

namespace mapweave::exporters {
namespace {

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    throw Error(ErrorCode::kCannotWrite, "cannot make the folder: " + error.message(), folder.string(),
                "choose another --out");
}

}  // namespace

std::vector<std::filesystem::path> write_map_folder(const std::filesystem::path& folder, const Map& map,
                                                    const OccupancyGrid& grid, const MapFolderOptions& options) {
  make_folder(folder);
  std::vector<std::filesystem::path> written;
  const auto put = [&](const std::filesystem::path& name, const std::string& bytes) {
    write_file(folder / name, bytes);
    written.push_back(name);
  };
  if (options.files.png && !grid.empty()) {
    put("map.png", grid_png(grid));
    put("map.color.png", map_picture_png(grid, session_trajectories(map), options.picture));
  }
  if (options.files.pgm && !grid.empty()) {
    write_map_server(grid, folder, "map");
    written.insert(written.end(), {"map.pgm", "map.yaml"});
  }
  if (options.files.pcd) put("map.pcd", pcd_bytes(map, options.cloud));
  if (options.files.tum) put("trajectory.tum", tum_text(map));
  if (options.files.robot_trajectories) {
    make_folder(folder / "trajectories");
    for (const RobotId robot : map.robots()) {
      MAPWEAVE_EXPECT(is_valid_name(robot.str()), "a robot's name must be able to be a file's name");
      const std::string text = tum_text(map, robot);
      if (!text.empty()) put(std::filesystem::path("trajectories") / (robot.str() + ".tum"), text);
    }
  }
  if (options.files.g2o) put("map.g2o", g2o_text(map));
  return written;
}

}  // namespace mapweave::exporters
