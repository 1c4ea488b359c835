// mapweave inspect: what is in a log or a folder of pictures, a map store, a server's journal, a map_server grid or a
// folder of results.

#include "command.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/hash.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/mapdb/update_journal.h>
#include <mapweave/rawlog/contents.h>
#include <mapweave/runtime/map_input.h>

#include <nlohmann/json.hpp>

#include <cmath>
#include <iostream>
#include <memory>

namespace mapweave::app {
namespace {

using Json = nlohmann::ordered_json;

Json of_camera(const rawlog::RecordedCameraGeometry& camera) {
  Json shown = {{"width", camera.width}, {"height", camera.height}, {"calibrated", camera.calibrated}};
  if (camera.calibrated) {
    for (const auto& [key, value] :
         {std::pair("fx", camera.fx), {"fy", camera.fy}, {"cx", camera.cx}, {"cy", camera.cy}})
      shown[key] = value;
    shown["distorted"] = camera.distorted;
  }
  if (camera.baseline_m > 0.0) shown["baseline_m"] = camera.baseline_m;
  if (camera.farthest_m > 0.0) {
    shown["nearest_m"] = camera.nearest_m;
    shown["farthest_m"] = camera.farthest_m;
    shown["least_depth_delay_s"] = camera.least_depth_delay_s;
    shown["most_depth_delay_s"] = camera.most_depth_delay_s;
  }
  return shown;
}

Json of_log(const std::filesystem::path& path) {
  const rawlog::LogContents contents = rawlog::summarize_log(path);
  Json sensors = Json::array();
  for (const rawlog::SensorContents& sensor : contents.sensors) {
    Json geometries = Json::array();
    for (const rawlog::LaserGeometry& laser : sensor.geometries)
      geometries.push_back({{"scans", laser.scans},
                            {"rays", laser.rays},
                            {"first_angle_rad", laser.first_angle_rad},
                            {"last_angle_rad", laser.last_angle_rad},
                            {"max_range_m", laser.max_range_m},
                            {"x_m", laser.x_m},
                            {"y_m", laser.y_m},
                            {"z_m", laser.z_m},
                            {"yaw_rad", laser.yaw_rad},
                            {"pitch_rad", laser.pitch_rad},
                            {"roll_rad", laser.roll_rad}});
    Json line = {{"label", sensor.label},
                 {"class", sensor.class_name},
                 {"count", sensor.count},
                 {"rate_hz", sensor.rate_hz},
                 {"longest_gap_s", sensor.longest_gap_s}};
    if (!geometries.empty()) line["lasers"] = geometries;
    if (sensor.camera) line["camera"] = of_camera(*sensor.camera);
    sensors.push_back(line);
  }
  return {{"kind", "log"},
          {"format", contents.format},
          {"observations", contents.observations},
          {"scans", contents.scans},
          {"first", contents.first.seconds()},
          {"last", contents.last.seconds()},
          {"duration_s", contents.duration_s},
          {"odometry_length_m", contents.odometry_length_m},
          {"sensors", sensors}};
}

Json of_map(const mapdb::StoredMapSummary& map) {
  Json sessions = Json::array();
  for (const mapdb::SessionSummary& session : map.sessions)
    sessions.push_back({{"id", to_string(session.id)}, {"nodes", session.nodes}});
  Json shown = {{"id", map.id.str()},
                {"nodes", map.nodes},
                {"contents", map.contents},
                {"keyframes", map.keyframes},
                {"landmarks", map.landmarks},
                {"submaps", map.submaps},
                {"constraints", map.constraints},
                {"first", map.first.seconds()},
                {"last", map.last.seconds()},
                {"min_x_m", map.min_x_m},
                {"min_y_m", map.min_y_m},
                {"max_x_m", map.max_x_m},
                {"max_y_m", map.max_y_m}};
  if (map.bytes > 0) shown["bytes"] = map.bytes, shown["stored_bytes"] = map.stored_bytes;
  shown["content"] = to_hex(map.content);
  shown["sessions"] = sessions;
  return shown;
}

Json of_store(const std::filesystem::path& path) {
  const mapdb::StoreSummary store = mapdb::summarize_store(path);
  Json maps = Json::array();
  for (const mapdb::StoredMapSummary& map : store.maps) maps.push_back(of_map(map));
  return {{"kind", "map store"},
          {"schema", store.schema},
          {"file_bytes", store.file_bytes},
          {"maps", maps},
          {"judgements", store.judgements},
          {"verdicts", store.verdicts},
          {"members", store.members},
          {"metadata", store.metadata},
          {"identity", to_hex(store.identity)}};
}

Json of_journal(const std::filesystem::path& path) {
  const runtime::MapInput input = runtime::read_map_input(path, MapId(path.stem().string()));
  std::uint64_t updates = 0, file_bytes = 0;
  mapdb::UpdateJournal::left_behind(path).replay([&](const mapdb::JournalEntry& entry) { updates += !entry.vetoed; });
  for (const std::filesystem::path& file : input.files) file_bytes += std::filesystem::file_size(file);
  Json maps = Json::array();
  for (const Map& map : input.maps) maps.push_back(of_map(mapdb::summary_of(map)));
  return {{"kind", "journal of a live map server"}, {"file_bytes", file_bytes}, {"updates", updates}, {"maps", maps}};
}

Json of_grid(const std::filesystem::path& path) {
  const OccupancyGrid grid = exporters::read_map_server(path);
  std::uint64_t walls = 0, free_cells = 0;
  for (const std::int16_t cell : grid.log_odds) {
    walls += cell > OccupancyGrid::kUnknown;
    free_cells += cell < OccupancyGrid::kUnknown;
  }
  const double cell_m2 = grid.resolution_m * grid.resolution_m;
  return {{"kind", "map_server grid"},
          {"columns", grid.columns},
          {"rows", grid.rows},
          {"resolution_m", grid.resolution_m},
          {"origin_x_m", grid.origin_x_m},
          {"origin_y_m", grid.origin_y_m},
          {"width_m", grid.columns * grid.resolution_m},
          {"height_m", grid.rows * grid.resolution_m},
          {"wall_m2", static_cast<double>(walls) * cell_m2},
          {"free_m2", static_cast<double>(free_cells) * cell_m2}};
}

Json parsed_file(const std::filesystem::path& path) {
  try {
    return Json::parse(read_file(path));
  } catch (const Json::exception& error) {
    throw Error(ErrorCode::kCorrupt, error.what(), path.string(), "make the results again");
  }
}

// The manifest's files: how many are as they were written, and which are not.
Json checked_files(const std::filesystem::path& folder, const Json& manifest) {
  std::uint64_t unchanged = 0;
  Json changed = Json::array(), missing = Json::array();
  for (const char* group : {"outputs", "outputs_with_times"}) {
    if (!manifest.contains(group) || !manifest[group].is_object()) continue;
    for (const auto& [file, checksum] : manifest[group].items()) {
      if (!std::filesystem::is_regular_file(folder / file))
        missing.push_back(file);
      else if (checksum != to_hex(hash_of_file(folder / file)))
        changed.push_back(file);
      else
        ++unchanged;
    }
  }
  return {{"unchanged", unchanged}, {"changed", changed}, {"missing", missing}};
}

Json of_results(const std::filesystem::path& folder) {
  const Json manifest = parsed_file(folder / "manifest.json");
  Json result = {{"kind", "results"}};
  for (const char* key : {"verb", "versions", "seed", "inputs"})
    if (manifest.contains(key)) result[key] = manifest[key];
  result["files"] = checked_files(folder, manifest);
  if (std::filesystem::exists(folder / "summary.json")) result["summary"] = parsed_file(folder / "summary.json");
  if (std::filesystem::exists(folder / "merges.json")) result["merges"] = parsed_file(folder / "merges.json");
  return result;
}

Json contents_of(const std::filesystem::path& path) {
  if (std::filesystem::exists(path / "manifest.json")) return of_results(path);
  if (std::filesystem::exists(path / "map.mwdb"))
    return of_store(path / "map.mwdb");  // a part of results: one map with its pictures
  if (path.extension() == ".mwdb") return of_store(path);
  if (path.extension() == ".mwj") return of_journal(path);
  if (path.extension() == ".yaml" || path.extension() == ".yml") return of_grid(path);
  return of_log(path);
}

// "key: value" lines, indented as YAML is; `first` stands before the first line instead of `indent`.
void print(const Json& value, const std::string& first, const std::string& indent) {
  std::string before = first;
  for (const auto& [key, item] : value.items()) {
    const bool is_flat_list = item.is_array() && (item.empty() || !item.front().is_structured());
    const bool is_nested = item.is_structured() && !item.empty() && !is_flat_list;
    if (value.is_array()) {
      if (is_nested)
        print(item, before + "- ", indent + "  ");
      else
        std::cout << before << "- " << (item.is_string() ? item.get<std::string>() : item.dump()) << '\n';
    } else if (is_nested) {
      std::cout << before << key << ":\n";
      print(item, indent + "  ", indent + "  ");
    } else {
      std::cout << before << key << ": " << (item.is_string() ? item.get<std::string>() : item.dump()) << '\n';
    }
    before = indent;
  }
}

}  // namespace

Action set_up_inspect(CLI::App& verb) {
  struct Arguments {
    std::filesystem::path path;
    bool json = false;
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("PATH", arguments->path,
                  "a log or a folder of pictures, a map (.mwdb), a live map server's journal (.mwj), a map_server grid "
                  "(.yaml) or a folder "
                  "of results")
      ->required();
  verb.add_flag("--json", arguments->json, "print JSON");
  return [arguments] {
    const Json contents = contents_of(arguments->path);
    if (arguments->json)
      std::cout << contents.dump(2) << '\n';
    else
      print(contents, "", "");
    return ExitCode::done;
  };
}

}  // namespace mapweave::app
