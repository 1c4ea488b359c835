#pragma once
// A small folder of results, written by hand.

#include <mapweave/core/files.h>
#include <mapweave/core/format.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/report/report_page.h>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::report::test {

using Json = nlohmann::ordered_json;

inline void write_text(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::create_directories(path.parent_path());
  write_file(path, text);
}

// Walls around free space.
inline OccupancyGrid room(int columns, int rows) {
  OccupancyGrid grid;
  grid.columns = columns;
  grid.rows = rows;
  grid.log_odds.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), -100);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column)
      if (row == 0 || column == 0 || row == rows - 1 || column == columns - 1)
        grid.log_odds[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                      static_cast<std::size_t>(column)] = 100;
  return grid;
}

// Along x at 1 m/s, a pose each tenth of a second.
inline std::string straight_tum(int poses, double y_m = 0.0, int first = 0) {
  std::string text;
  for (int i = first; i < first + poses; ++i)
    text += format("%.3f %.3f %.3f 0 0 0 0 1\n", 100.0 + 0.1 * i, 0.1 * i, y_m + 0.001 * (i % 7));
  return text;
}

inline void write_map(const std::filesystem::path& folder, int columns = 60, int rows = 40) {
  std::filesystem::create_directories(folder);
  exporters::write_map_server(room(columns, rows), folder, "map");
}

inline Json verdict(const std::string& a, const std::string& b) {
  return {
      {"tier", "cloud"},
      {"words", a + " + " + b + ": merged"},
      {"a", a},
      {"b", b},
      {"accepted", true},
      {"decision", "accepted"},
      {"reason", "none"},
      {"because", "no doubt"},
      {"in_one_map", true},
      {"b_from_a", {{"x", 1.0}, {"y", 2.0}, {"yaw", 0.25}}},
      {"hypotheses", {{{"sense", "lasers"}, {"b_from_a", {{"x", 1.0}, {"y", 2.0}, {"yaw", 0.25}}}, {"matches", 3}}}}};
}

// Of `run`: a team map, each robot's own, one verdict for each pair.
inline void write_results(const std::filesystem::path& folder, const std::vector<std::string>& robots, int poses = 50) {
  Json summary = {{"robots", Json::array()}, {"team", {{"members", {robots}}}},
                  {"notes", Json::array()},  {"interrupted", false},
                  {"exit_code", 0},          {"wall_seconds", 12.5},
                  {"peak_rss_bytes", 1000},  {"stages", Json::array()}};
  Json merges = Json::array();
  write_map(folder / "team");
  for (std::size_t i = 0; i < robots.size(); ++i) {
    summary["robots"].push_back({{"id", robots[i]}, {"scans", poses}, {"mapped", true}, {"edge", "north"}});
    for (std::size_t j = i + 1; j < robots.size(); ++j) merges.push_back(verdict(robots[i], robots[j]));
    const std::string text = straight_tum(poses, static_cast<double>(i));
    write_text(folder / "team/trajectories" / (robots[i] + ".tum"), text);
    write_map(folder / "robots" / robots[i]);
    write_text(folder / "robots" / robots[i] / "trajectory.tum", text);
  }
  write_text(folder / "summary.json", summary.dump());
  write_text(folder / "merges.json", merges.dump());
  write_text(folder / "config.yaml", "seed: 7\n");
  write_text(
      folder / "manifest.json",
      Json({{"verb", "run"}, {"versions", {{"mapweave", "0.1.0"}}}, {"seed", 7}, {"inputs", Json::array()}}).dump());
}

inline std::string between(const std::string& text, const std::string& before, const std::string& after) {
  const std::size_t begin = text.find(before);
  if (begin == std::string::npos) return {};
  const std::size_t from = begin + before.size();
  return text.substr(from, text.find(after, from) - from);
}

// What the page's scripts read.
inline Json data_of(const std::string& page) {
  return Json::parse(between(page, "<script type=\"application/json\" id=\"run\">", "</script>"));
}

inline std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

}  // namespace mapweave::report::test
