// mapweave inspect: what is in a log or a folder of pictures, and in everything that the program writes.

#include "command.h"
#include "configuration.h"
#include "inspected_files.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/hash.h>
#include <mapweave/core/options.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/mapdb/update_journal.h>
#include <mapweave/rawlog/contents.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/map_input.h>

#include <nlohmann/json.hpp>

#include <cmath>
#include <iostream>
#include <memory>
#include <sstream>

namespace mapweave::app {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kDamage = "damage";  // why what the store lists cannot be read

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

// What --set can reach.
struct Settings {
  rawlog::ReadOptions reading;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("reading", reading, "what the log does not say itself");
  }
};

Json of_topics(const std::vector<rawlog::TopicContents>& topics) {
  Json shown = Json::array();
  for (const rawlog::TopicContents& topic : topics) {
    Json line = {{"topic", topic.name},
                 {"type", topic.type},
                 {"count", topic.count},
                 {"rate_hz", topic.rate_hz},
                 {"longest_gap_s", topic.longest_gap_s}};
    if (!topic.frames.empty()) line["frames"] = topic.frames;
    if (topic.cloud)
      line["points"] = {{"width", topic.cloud->width},
                        {"height", topic.cloud->height},
                        {"organised", topic.cloud->height > 1},
                        {"fields", topic.cloud->fields}};
    shown.push_back(line);
  }
  return shown;
}

Json of_log(const std::filesystem::path& path, const std::vector<std::string>& set) {
  Settings settings;
  load(settings, {{}, environment_for(fields_of(settings)), set});
  const rawlog::LogContents contents = rawlog::summarize_log(path, settings.reading);
  if (!contents.trouble.empty())
    return {{"kind", "log"},
            {"format", contents.format},
            {"topics", of_topics(contents.topics)},
            {"not_read_as_it_is", contents.trouble}};
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
  Json shown = {{"kind", "log"},
                {"format", contents.format},
                {"observations", contents.observations},
                {"scans", contents.scans},
                {"first", contents.first.seconds()},
                {"last", contents.last.seconds()},
                {"duration_s", contents.duration_s},
                {"odometry_length_m", contents.odometry_length_m},
                {"sensors", sensors}};
  if (!contents.topics.empty()) shown["topics"] = of_topics(contents.topics);
  if (!contents.doubts.empty()) shown["doubts"] = contents.doubts;
  return shown;
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
  if (map.bytes > 0) {
    shown["bytes"] = map.bytes;
    shown["stored_bytes"] = map.stored_bytes;
  }
  shown["content"] = to_hex(map.content);
  shown["sessions"] = sessions;
  return shown;
}

Json of_store(const std::filesystem::path& path) {
  const mapdb::StoreSummary store = mapdb::summarize_store(path);
  Json damage;
  try {
    mapdb::read_store(path);
  } catch (const Error& error) {
    damage = error.what();
  }
  Json maps = Json::array();
  for (const mapdb::StoredMapSummary& map : store.maps) maps.push_back(of_map(map));
  Json shown = {{"kind", "map store"},
                {"schema", store.schema},
                {"file_bytes", store.file_bytes},
                {"maps", maps},
                {"judgements", store.judgements},
                {"verdicts", store.verdicts},
                {"members", store.members},
                {"metadata", store.metadata},
                {"identity", to_hex(store.identity)}};
  if (!damage.is_null()) shown[kDamage] = damage;
  return shown;
}

Json of_journal(const std::filesystem::path& path) {
  const runtime::MapInput input = runtime::read_map_input(path, MapId(path.stem().string()));
  std::uint64_t updates = 0, file_bytes = 0;
  mapdb::UpdateJournal::left_behind(path).replay([&](const mapdb::JournalEntry& entry) { updates += !entry.vetoed; });
  for (const std::filesystem::path& file : input.files) file_bytes += std::filesystem::file_size(file);
  Json maps = Json::array();
  for (const Map& map : input.maps) maps.push_back(of_map(mapdb::summary_of(map)));
  return {{"kind", "journal of a live camera map server"},
          {"file_bytes", file_bytes},
          {"updates", updates},
          {"maps", maps}};
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

Json of_manifest(const std::filesystem::path& folder) {
  const Json manifest = parsed_file(folder / "manifest.json");
  Json result = {{"kind", "manifest of results"}};
  for (const char* key : {"verb", "versions", "seed", "inputs"})
    if (manifest.contains(key)) result[key] = manifest[key];
  result["files"] = checked_files(folder, manifest);
  return result;
}

Json of_results(const std::filesystem::path& folder) {
  Json result = of_manifest(folder);
  result["kind"] = "results";
  if (std::filesystem::exists(folder / "summary.json")) result["summary"] = parsed_file(folder / "summary.json");
  if (std::filesystem::exists(folder / "merges.json")) result["merges"] = parsed_file(folder / "merges.json");
  return result;
}

// A file of results, or another one of the program.
Json of_json(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  if (name == "manifest.json") return of_manifest(path.parent_path());
  if (name == "summary.json") return {{"kind", "summary of results"}, {"summary", parsed_file(path)}};
  if (name == "merges.json") return {{"kind", "pairs of maps"}, {"merges", parsed_file(path)}};
  return {{"kind", "JSON"}, {"contents", parsed_file(path)}};
}

// "alpha: 225 scans of 59 s, edge north"
std::string robot_line(const Json& robot) {
  std::ostringstream line;
  line << robot.value("id", "") << ": " << robot.value("scans", 0) << " scans";
  std::uint64_t frames = 0;
  for (const Json& camera : robot.value("cameras", Json::array())) frames += camera.value("frames", 0);
  if (frames > 0) line << ", " << frames << " frames";
  line << " of " << std::lround(robot.value("log_seconds", 0.0)) << " s";
  if (robot.contains("edge")) line << ", edge " << robot.value("edge", "");
  if (!robot.value("mapped", true)) line << ", no map";
  if (robot.contains("trouble")) line << "; " << robot.value("trouble", "");
  return line.str();
}

// Results for people: a line a pair, a line a robot, no tables of times.
Json in_brief(Json contents) try {
  if (contents.contains("merges") && contents["merges"].is_array()) {
    Json lines = Json::array();
    for (const Json& pair : contents["merges"]) {
      const std::string tier = pair.value("tier", "");
      lines.push_back((tier.empty() || tier == "cloud" ? "" : "edge " + tier + ": ") + pair.value("words", ""));
    }
    contents["merges"] = lines;
  }
  if (contents.contains("summary") && contents["summary"].is_object()) {
    Json& summary = contents["summary"];
    Json robots = Json::array();
    for (const Json& robot : summary.value("robots", Json::array())) robots.push_back(robot_line(robot));
    summary["robots"] = robots;
    for (const char* key : {"stages", "timeline", "edges", "coordinator"}) summary.erase(key);
  }
  if (contents.contains("inputs") && contents["inputs"].is_array()) {
    Json paths = Json::array();
    for (const Json& input : contents["inputs"]) paths.push_back(input.is_object() ? input.value("path", "") : "");
    contents["inputs"] = paths;
  }
  return contents;
} catch (const Json::exception& error) {
  throw Error(ErrorCode::kCorrupt, error.what(), {}, "make the results again, or look at them with --json");
}

Json contents_of(const std::filesystem::path& path, const std::vector<std::string>& set) {
  std::error_code ignored;
  if (std::filesystem::exists(path / "manifest.json", ignored)) return of_results(path);
  if (std::filesystem::exists(path / "map.mwdb", ignored))
    return of_store(path / "map.mwdb");  // a part of results: one map with its pictures
  if (path.extension() == ".mwdb") return of_store(path);
  if (path.extension() == ".mwj") return of_journal(path);
  if (path.extension() == ".json") return of_json(path);
  if (const auto contents = contents_of_file(path)) return *contents;
  if (path.extension() == ".yaml" || path.extension() == ".yml") return of_grid(path);
  return of_log(path, set);
}

// "key: value" lines, indented as YAML is; `first` stands before the first line instead of `indent`.
void print(const Json& value, const std::string& first, const std::string& indent) {
  std::string before = first;
  for (const auto& [key, item] : value.items()) {
    const bool is_flat_list =
        item.is_array() && (item.empty() || !(item.front().is_structured() || item.front().is_string()));
    const bool is_nested = item.is_structured() && !item.empty() && !is_flat_list;
    if (value.is_array()) {
      if (is_nested)
        print(item, before + "- ", indent + "  ");
      else
        std::cout << before << "- " << (item.is_string() ? item.get<std::string>() : runtime::json_text(item, -1))
                  << '\n';
    } else if (is_nested) {
      std::cout << before << key << ":\n";
      print(item, indent + "  ", indent + "  ");
    } else {
      std::cout << before << key << ": " << (item.is_string() ? item.get<std::string>() : runtime::json_text(item, -1))
                << '\n';
    }
    before = indent;
  }
}

}  // namespace

Action set_up_inspect(CLI::App& verb) {
  struct Arguments {
    std::filesystem::path path;
    std::vector<std::string> set;
    bool json = false, all = false;
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("PATH", arguments->path,
                  "a log, a ROS bag or a folder of pictures, a map (.mwdb), a live camera map server's journal (.mwj), "
                  "a folder of "
                  "results, or any file in it: grids, configurations, trajectories, clouds, graphs, pictures, JSON")
      ->required();
  verb.add_option("--set", arguments->set, "how a log is read, as in reading.topics=[/scan, /odom]")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  verb.add_flag("--all", arguments->all, "all that is known of each pair and robot, instead of a line");
  verb.add_flag("--json", arguments->json, "print JSON, with everything");
  return [arguments] {
    const Json contents = contents_of(arguments->path, arguments->set);
    if (arguments->json)
      std::cout << runtime::json_text(contents) << '\n';
    else
      print(arguments->all ? contents : in_brief(contents), "", "");
    if (!contents.contains(kDamage)) return ExitCode::done;
    throw Error(ErrorCode::kCorrupt, "what is listed cannot be read: " + contents[kDamage].get<std::string>());
  };
}

}  // namespace mapweave::app
