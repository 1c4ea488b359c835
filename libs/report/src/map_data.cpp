#include "map_data.h"

#include "grid_levels.h"
#include "map_links.h"
#include "trajectory_data.h"
#include "view_bounds.h"

#include <mapweave/core/files.h>
#include <mapweave/core/hash.h>
#include <mapweave/evaluation/tum_trajectory.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/mapdb/map_store.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace mapweave::report {
namespace {

constexpr std::string_view kTum = ".tum";

std::string name_of_tum(const std::string& file) {
  const bool is_tum = file.size() > kTum.size() && file.substr(file.size() - kTum.size()) == kTum;
  return is_tum ? file.substr(0, file.size() - kTum.size()) : std::string();
}

std::string in(const std::string& folder, const std::string& file) {
  return folder.empty() ? file : folder + "/" + file;
}

bool holds_map(const ResultFiles& files, const std::string& folder) {
  for (const char* file : {"map.mwdb", "map.yaml", "map.png", "map.pcd", "trajectory.tum"})
    if (files.has(in(folder, file))) return true;
  return !files.files_in(in(folder, "trajectories")).empty();
}

std::vector<ReportMap> find_maps(const ResultFiles& files, const std::vector<std::string>& robots) {
  std::vector<ReportMap> maps;
  const auto add = [&](const std::string& folder, const char* kind, const std::string& name, const std::string& title) {
    if (!holds_map(files, folder)) return;
    ReportMap map;
    map.folder = folder;
    map.kind = kind;
    map.name = name;
    map.title = title;
    maps.push_back(map);
  };
  const std::vector<std::string> folders = files.folders_in("");
  add("team", "team", "team", "team map");
  for (std::size_t i = 1; i <= folders.size(); ++i)
    add("team-" + std::to_string(i), "team", "team-" + std::to_string(i), "team map " + std::to_string(i) + ", apart");
  const auto add_robot = [&](const std::string& folder, const std::string& robot, const char* kind,
                             const std::string& title) {
    add(folder, kind, robot, title);
    for (std::size_t i = 1; i <= files.folders_in(folder).size(); ++i) {
      const std::string number = std::to_string(i);
      add(in(folder, "apart-" + number), kind, robot + "." + number, title + ", apart " + number);
    }
  };
  for (const std::string& name : files.folders_in("robots")) {
    add_robot("robots/" + name, name, "robot", name);
    add_robot("robots/" + name + "/cameras", name, "cameras", name + ", its cameras");
  }
  if (maps.empty() && robots.size() <= 1) {
    const std::string name = robots.empty() ? "map" : robots.front();
    add_robot("", name, "robot", name);
    add_robot("cameras", name, "cameras", name + ", its cameras");
  }
  return maps;
}

void read_trajectories(ResultFiles& files, const std::vector<std::string>& robots, ReportMap& map) {
  const auto read = [&](const std::string& file, const std::string& robot) {
    const auto place = std::find(robots.begin(), robots.end(), robot);
    if (place == robots.end()) return;
    files.attempt(file, [&] {
      map.trajectories.push_back(
          {static_cast<std::size_t>(place - robots.begin()), evaluation::read_tum(files.path(file))});
    });
  };
  const std::string folder = in(map.folder, "trajectories");
  for (const std::string& file : files.files_in(folder)) read(folder + "/" + file, name_of_tum(file));
  if (!map.trajectories.empty()) return;
  const std::string file = in(map.folder, "trajectory.tum");
  std::string robot = map.name;
  if (std::find(robots.begin(), robots.end(), robot) == robots.end()) robot = robot.substr(0, robot.rfind('.'));
  if (map.kind == "team" && robots.size() == 1) robot = robots.front();
  if (files.has(file)) read(file, robot);
}

void read_links(ResultFiles& files, ReportMap& map) {
  const std::string file = in(map.folder, "map.mwdb");
  if (!files.has(file)) {
    if (map.kind == "team") files.miss(file);
    return;
  }
  files.attempt(file, [&] {
    const mapdb::StoredMaps stored = mapdb::read_store(files.path(file));
    if (stored.maps.empty()) return;
    map.json.update(links_json(stored.maps.front(), map.kind == "team" ? 1500 : 200));
  });
}

void read_grid(ResultFiles& files, ReportMap& map, bool has_many, ViewBounds& bounds) {
  if (!files.has(in(map.folder, "map.yaml"))) return;
  files.attempt(in(map.folder, "map.yaml"), [&] {
    const OccupancyGrid grid = exporters::read_map_server(files.path(in(map.folder, "map.yaml")));
    if (!has_known_cells(grid)) return;
    const bool is_main = map.kind == "team" || !has_many;
    const DrawnGrid drawn = drawn_grid(grid, is_main ? GridDetail{1000, 4000} : GridDetail{1000, 1000});
    map.json["grid"] = drawn.json;
    bounds.add(drawn);
  });
}

void read_points(ResultFiles& files, ReportMap& map, ViewBounds& bounds) {
  for (const char* name : {"map.dense.pcd", "map.pcd"}) {
    const std::string file = in(map.folder, name);
    if (!map.points.empty() || !files.has(file)) continue;
    files.attempt(file, [&] { map.points = parse_pcd(read_file(files.path(file)), file); });
    if (!is_in_space(map.points)) map.points.clear();  // walls, which the grid shows
    map.points_file = file;
  }
  if (map.points.empty()) return;
  const PointBounds most = bounds_of(map.points);
  bounds.add(most.low_x, most.low_y);
  bounds.add(most.high_x, most.high_y);
}

// Pictures without coordinates, where nothing else shows the map.
void read_picture(ResultFiles& files, ReportMap& map) {
  if (map.json.contains("grid") || !map.points.empty()) return;
  for (const char* name : {"map.color.png", "map.png"}) {
    const std::string file = in(map.folder, name);
    if (map.json.contains("picture") || !files.has(file)) continue;
    files.attempt(file, [&] { map.json["picture"] = data_url("png", read_file(files.path(file), 1 << 26)); });
  }
}

// The map in whose frame a pair's conflicts are.
ReportMap* map_of_conflicts(std::vector<ReportMap>& maps, const Json& verdict, const Json& teams) {
  const std::string a = verdict.value("a", ""), b = verdict.value("b", "");
  std::string name = a, kind = "robot";
  if (!verdict["audit"].value("taken_apart", false)) {
    kind = "team";
    name = "";
    const bool has_main =  // results in which all is in one map, and those of earlier versions
        std::any_of(maps.begin(), maps.end(), [](const ReportMap& map) { return map.name == "team"; });
    for (std::size_t i = 0; i < teams.size(); ++i)
      if (std::count(teams[i].begin(), teams[i].end(), a) > 0 && std::count(teams[i].begin(), teams[i].end(), b) > 0)
        name = i == 0 && has_main ? "team" : "team-" + std::to_string(has_main ? i : i + 1);
  }
  const auto found = std::find_if(maps.begin(), maps.end(),
                                  [&](const ReportMap& map) { return map.kind == kind && map.name == name; });
  return found == maps.end() ? nullptr : &*found;
}

void add_conflicts(std::vector<ReportMap>& maps, const Json& summary, const Json& merges) {
  const Json teams =
      summary.is_object() && summary.contains("team") ? summary["team"].value("members", Json::array()) : Json::array();
  for (Json verdict : merges) {
    if (!verdict.is_object() || verdict.value("tier", "") != "cloud" || !verdict.contains("audit") ||
        !verdict["audit"].is_object())
      continue;
    if (ReportMap* map = map_of_conflicts(maps, verdict, teams))
      for (const Json& conflict : verdict["audit"].value("conflicts", Json::array()))
        map->json["conflicts"].push_back(rounded(conflict, 2));
  }
}

}  // namespace

std::vector<std::string> robot_names(const ResultFiles& files, const Json& summary) {
  std::set<std::string> names;
  if (summary.is_object())
    for (const Json& robot : summary.value("robots", Json::array()))
      if (robot.is_object()) names.insert(robot.value("id", ""));
  if (names.empty()) {
    for (const std::string& name : files.folders_in("robots")) names.insert(name);
    for (const std::string& folder : files.folders_in(""))
      if (folder.compare(0, 4, "team") == 0)
        for (const std::string& file : files.files_in(folder + "/trajectories")) names.insert(name_of_tum(file));
  }
  names.erase("");
  if (names.empty() && holds_map(files, "")) names.insert("map");  // a robot's folder, without its summary
  return {names.begin(), names.end()};
}

std::vector<ReportMap> read_maps(ResultFiles& files, const std::vector<std::string>& robots, const Json& summary,
                                 const Json& merges) {
  std::vector<ReportMap> maps = find_maps(files, robots);
  for (ReportMap& map : maps) {
    map.json = {{"kind", map.kind},       {"name", map.name},       {"title", map.title},        {"has_links", false},
                {"loops", Json::array()}, {"joins", Json::array()}, {"conflicts", Json::array()}};
    ViewBounds bounds;
    read_grid(files, map, maps.size() > 1, bounds);
    read_points(files, map, bounds);
    read_picture(files, map);
    read_trajectories(files, robots, map);
    if (map.kind != "cameras") read_links(files, map);
    for (const RobotTrajectory& trajectory : map.trajectories)
      for (const evaluation::TrajectoryPoint& point : trajectory.poses) bounds.add(point.pose.t.x(), point.pose.t.y());
    map.json["view"] = bounds.json();
  }
  files.attempt("merges.json", [&] { add_conflicts(maps, summary, merges); });
  return maps;
}

Json maps_json(const std::vector<ReportMap>& maps, std::size_t most_bytes) {
  // As poses are written, with a rounded stamp; more poses or points than that show no more on a screen; fewer poses no
  // path.
  constexpr std::size_t kBytesOfPose = 22, kMostPosesEach = 6000, kLeastPosesEach = 20, kMostPoints = 200'000;
  std::size_t trajectories = 0, with_points = 0, poses = 0;
  for (const ReportMap& map : maps) {
    trajectories += map.trajectories.size() + map.references.size();
    with_points += map.points.empty() ? 0 : 1;
  }
  const std::size_t for_poses = with_points == 0 ? most_bytes : most_bytes / 2;
  const std::size_t poses_each =
      std::clamp(for_poses / kBytesOfPose / std::max<std::size_t>(trajectories, 1), kLeastPosesEach, kMostPosesEach);
  for (const ReportMap& map : maps)
    for (const auto* list : {&map.trajectories, &map.references})
      for (const RobotTrajectory& trajectory : *list) poses += std::min(trajectory.poses.size(), poses_each);
  std::size_t points_left =
      std::min(kMostPoints, (most_bytes - std::min(most_bytes, poses * kBytesOfPose)) / kBytesOfPoint);
  Json json = Json::array();
  for (const ReportMap& map : maps) {
    Json one = map.json;
    for (const auto& [key, list] : {std::pair("trajectories", &map.trajectories), {"references", &map.references}}) {
      one[key] = Json::array();
      for (const RobotTrajectory& trajectory : *list) {
        Json line = trajectory_json(trajectory.poses, poses_each);
        line["robot"] = trajectory.robot;
        one[key].push_back(line);
      }
    }
    if (!map.points.empty()) {  // maps come in order of weight: what one leaves over, later ones have
      const std::size_t share = points_left / (&map == &maps.front() && with_points > 1 ? 2 : with_points);
      one["points"] = points_json(map.points, share, map.points_file);
      points_left -= std::min(map.points.size(), share);
      --with_points;
    }
    json.push_back(one);
  }
  return json;
}

}  // namespace mapweave::report
