#include <mapweave/exporters/map_folder.h>

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/exporters/g2o_file.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/exporters/top_view.h>
#include <mapweave/exporters/trajectory_files.h>

namespace mapweave::exporters {
namespace {

void make_out_folder(const std::filesystem::path& folder) {
  make_folder(folder, "choose another --out", "cannot make the folder");
}

// Files of trajectories by their names: one of a single robot at the top; each of several robots' in a file of its own.
std::vector<std::pair<std::filesystem::path, std::string>> trajectory_texts(const Map& map, bool named) {
  std::vector<std::pair<std::filesystem::path, std::string>> files;
  for (const RobotId robot : map.robots()) {
    MAPWEAVE_EXPECT(is_valid_name(robot.str()), "a robot's name must be able to be a file's name");
    if (std::string text = tum_text(map, robot); !text.empty())
      files.emplace_back(robot.str() + ".tum", std::move(text));
  }
  const bool is_single = files.size() == 1;
  const std::string single = is_single ? files.front().second : "";
  if (is_single && !named) files.clear();
  for (auto& [name, text] : files) name = "trajectories" / name;
  if (is_single) files.insert(files.begin(), {"trajectory.tum", single});
  return files;
}

}  // namespace

std::vector<std::filesystem::path> write_map_folder(const std::filesystem::path& folder, const Map& map,
                                                    const OccupancyGrid& grid, const MapFolderOptions& options) {
  make_out_folder(folder);
  std::vector<std::filesystem::path> written;
  const auto put = [&](const std::filesystem::path& name, const std::string& bytes) {
    write_file(folder / name, bytes);
    written.push_back(name);
  };
  const auto landmarks = options.files.png ? landmark_cloud(map) : std::vector<ColouredPoint>();
  if (options.files.png && !grid.empty()) {
    put("map.png", grid_png(grid));
    put("map.color.png", landmarks.empty()
                             ? map_picture_png(grid, session_trajectories(map), options.picture)
                             : top_view_png(landmarks, session_trajectories(map), options.picture, &grid));
  } else if (!landmarks.empty()) {
    put("map.png", top_view_png(landmarks, session_trajectories(map), options.picture));
  }
  if (options.files.pgm && !grid.empty()) {
    write_map_server(grid, folder, "map", options.identity);
    written.insert(written.end(), {"map.pgm", "map.yaml"});
  }
  if (options.files.pcd) put("map.pcd", pcd_bytes(map, options.cloud));
  if (options.files.tum)
    for (const auto& [name, text] : trajectory_texts(map, options.files.robot_trajectories)) {
      make_out_folder((folder / name).parent_path());
      put(name, text);
    }
  if (options.files.g2o) put("map.g2o", g2o_text(map));
  return written;
}

}  // namespace mapweave::exporters
