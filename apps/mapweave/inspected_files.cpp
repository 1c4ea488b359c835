#include "inspected_files.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/hash.h>
#include <mapweave/evaluation/relations.h>
#include <mapweave/evaluation/trajectory_file.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/rawlog/contents.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/simulation/world_options.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <sstream>
#include <string_view>

namespace mapweave::app {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw Error(ErrorCode::kCorrupt, what, file.string(), "make it again");
}

Json of_trajectory(const fs::path& file) {
  const evaluation::TrajectoryFile read = evaluation::read_trajectory(file);
  const evaluation::Trajectory& points = read.trajectory;
  const char* formats[] = {"TUM", "stamp x y theta", "EuRoC", "KITTI"};
  double length_m = 0.0;
  Eigen::Vector3d low = points.front().pose.t, high = low;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i > 0) length_m += (points[i].pose.t - points[i - 1].pose.t).norm();
    low = low.cwiseMin(points[i].pose.t);
    high = high.cwiseMax(points[i].pose.t);
  }
  Json contents = {
      {"kind", "trajectory"}, {"format", formats[static_cast<int>(read.format)]}, {"poses", points.size()}};
  if (read.has_stamps)
    contents.update({{"first", points.front().stamp.seconds()},
                     {"last", points.back().stamp.seconds()},
                     {"duration_s", seconds_between(points.front().stamp, points.back().stamp)}});
  contents.update({{"length_m", length_m},
                   {"min_x_m", low.x()},
                   {"min_y_m", low.y()},
                   {"min_z_m", low.z()},
                   {"max_x_m", high.x()},
                   {"max_y_m", high.y()},
                   {"max_z_m", high.z()}});
  return contents;
}

// Who gave each pose of a robot.tum; else a trajectory.
Json of_csv(const fs::path& file) {
  std::istringstream text(read_file(file));
  std::string line;
  if (!std::getline(text, line) || line.rfind("stamp_s,source,leader,", 0) != 0) return of_trajectory(file);
  std::map<std::string, std::uint64_t> poses, events;
  std::uint64_t count = 0;
  for (; std::getline(text, line); ++count) {
    std::istringstream cells(line);
    std::string cell;
    for (int i = 0; std::getline(cells, cell, ','); ++i) {
      if (i == 1) ++poses[cell];
      if (i == 5 && !cell.empty()) ++events[cell];
    }
  }
  return {{"kind", "sources of a robot's poses"}, {"poses", count}, {"by", poses}, {"events", events}};
}

// Lines that are no comments.
std::size_t entries_in(const fs::path& file) {
  std::size_t entries = 0;
  std::istringstream text(read_file(file));
  for (std::string line; std::getline(text, line);) entries += !line.empty() && line.front() != '#';
  return entries;
}

// nullopt for a log, whatever it is called.
std::optional<Json> of_text(const fs::path& file) {
  for (const char* name : {"rgb.txt", "depth.txt", "associations.txt", "times.txt"})
    if (file.filename() == name) return Json{{"kind", "list of a folder of pictures"}, {"entries", entries_in(file)}};
  constexpr std::string_view kTimes = ".times.txt";  // beside poses of KITTI
  const std::string name = file.filename().string();
  if (name.size() > kTimes.size() && name.compare(name.size() - kTimes.size(), kTimes.size(), kTimes) == 0)
    return Json{{"kind", "times of poses"}, {"entries", entries_in(file)}};
  try {
    rawlog::format_of_log(file);
    return std::nullopt;
  } catch (const Error&) {
    return of_trajectory(file);
  }
}

Json of_relations(const fs::path& file) {
  return {{"kind", "relations"}, {"relations", evaluation::read_relations(file).size()}};
}

// nullopt for a log: a g2o file with scans.
std::optional<Json> of_graph(const fs::path& file) {
  std::map<std::string, std::uint64_t> counts;
  std::istringstream text(read_file(file));
  for (std::string line; std::getline(text, line);) {
    const std::string tag = line.substr(0, line.find(' '));
    if (tag.find("LASER") != std::string::npos) return std::nullopt;
    if (!tag.empty() && tag.front() != '#') ++counts[tag];
  }
  Json contents = {{"kind", "pose graph (g2o)"}, {"vertices", 0}, {"edges", 0}};
  for (const auto& [tag, count] : counts) {
    const char* kind = tag.compare(0, 6, "VERTEX") == 0 ? "vertices" : "edges";
    if (tag.compare(0, 4, "EDGE") == 0 || kind[0] == 'v') contents[kind] = contents[kind].get<std::uint64_t>() + count;
    contents["lines"][tag] = count;
  }
  return contents;
}

// The lines before the binary part: "WORD rest", by their first words; `end`: begins the last one.
std::map<std::string, std::string> header_of(const fs::path& file, const std::string& end) {
  constexpr std::size_t kMostLines = 200;
  std::map<std::string, std::string> header;
  std::istringstream text(read_file(file));
  std::string line;
  for (std::size_t i = 0; i < kMostLines && std::getline(text, line); ++i) {
    std::string word = line.substr(0, line.find(' '));
    if (word == "element") word = line.substr(0, line.find(' ', word.size() + 1));  // of PLY
    header[word] = line.size() > word.size() ? line.substr(word.size() + 1) : "";
    if (word == end) return header;
  }
  refuse(file, "its header has no end");
}

Json number_or_text(const std::map<std::string, std::string>& header, const std::string& key) {
  const auto found = header.find(key);
  if (found == header.end()) return {};
  std::istringstream text(found->second);
  double value = 0.0;
  if (!(text >> value) || !text.eof()) return found->second;
  return value == std::floor(value) ? Json(static_cast<std::int64_t>(value)) : Json(value);
}

Json of_pcd(const fs::path& file) {
  const auto header = header_of(file, "DATA");
  return {{"kind", "point cloud (PCD)"},
          {"points", number_or_text(header, "POINTS")},
          {"fields", number_or_text(header, "FIELDS")},
          {"data", number_or_text(header, "DATA")}};
}

Json of_ply(const fs::path& file) {
  const auto header = header_of(file, "end_header");
  return {{"kind", "point cloud (PLY)"},
          {"points", number_or_text(header, "element vertex")},
          {"data", number_or_text(header, "format")}};
}

Json of_octomap(const fs::path& file) {
  const auto header = header_of(file, "data");
  return {{"kind", "OctoMap"},
          {"tree", number_or_text(header, "id")},
          {"nodes", number_or_text(header, "size")},
          {"resolution_m", number_or_text(header, "res")}};
}

Json of_png(const fs::path& file) {
  const std::string bytes = read_file(file);
  if (bytes.size() < 24 || bytes.compare(1, 3, "PNG") != 0) refuse(file, "this is no PNG");
  const auto number_at = [&](std::size_t place) {
    std::uint32_t value = 0;
    for (std::size_t i = place; i < place + 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[i]);
    return value;
  };
  return {{"kind", "picture"}, {"columns", number_at(16)}, {"rows", number_at(20)}};
}

Json of_pgm(const fs::path& file) {
  std::istringstream text(read_file(file));
  std::string magic, word;
  std::vector<int> numbers;
  text >> magic;
  while (magic == "P5" && numbers.size() < 2 && text >> word) {
    if (word.front() == '#')
      std::getline(text, word);
    else
      numbers.push_back(std::atoi(word.c_str()));
  }
  if (numbers.size() < 2) refuse(file, "this is no PGM");
  return {{"kind", "cells of a map_server grid"},
          {"columns", numbers[0]},
          {"rows", numbers[1]},
          {"described_by", file.stem().string() + ".yaml"}};
}

Json of_page(const fs::path& file) { return {{"kind", "page for a browser"}, {"file_bytes", fs::file_size(file)}}; }

Json of_vocabulary(const fs::path& file) {
  const matching::BinaryVocabulary words = matching::load_vocabulary(file);
  return {{"kind", "vocabulary"},
          {"branching", words.branching()},
          {"levels", words.levels()},
          {"words", words.words()},
          {"hash", to_hex(words.hash())}};
}

// "section.key" and value of a configuration as to_yaml() writes it, without elements of lists.
std::map<std::string, std::string> values_in(const std::string& yaml) {
  std::map<std::string, std::string> values;
  std::vector<std::string> path;
  std::size_t list_at = std::string::npos;  // indentation of the list that is being skipped
  std::istringstream text(yaml);
  for (std::string line; std::getline(text, line);) {
    const std::size_t indent = line.find_first_not_of(' '), colon = line.find(':');
    if (indent == std::string::npos || colon == std::string::npos || indent >= list_at) continue;
    list_at = line[indent] == '-' ? indent : std::string::npos;
    if (line[indent] == '-') continue;
    path.resize(indent / 2);
    path.push_back(line.substr(indent, colon - indent));
    if (colon + 2 >= line.size()) continue;
    std::string key;
    for (const std::string& name : path) key += (key.empty() ? "" : ".") + name;
    values[key] = line.substr(colon + 2);
  }
  return values;
}

template <class Options>
Json of_configuration(const Options& options, const char* kind) {
  Json contents = {{"kind", kind}};
  const auto defaults = values_in(to_yaml(Options()));
  Json changed = Json::object();
  for (const auto& [key, value] : values_in(to_yaml(options)))
    if (const auto known = defaults.find(key); known != defaults.end() && known->second != value) changed[key] = value;
  contents["options"] = changed;
  return contents;
}

Json of_run(const fs::path& file) {
  runtime::RunConfiguration run;
  load(run, {{file}, {}, {}});
  Json contents = of_configuration(run, "configuration of a run"), robots = Json::array(), edges = Json::array();
  for (const runtime::RobotEntry& robot : run.robots)
    robots.push_back(robot.id + ": " + robot.log + (robot.edge.empty() ? "" : ", edge " + robot.edge));
  for (const runtime::EdgeEntry& edge : run.edges) edges.push_back(edge.id);
  contents["robots"] = robots;
  if (!edges.empty()) contents["edges"] = edges;
  return contents;
}

Json of_world(const fs::path& file) {
  simulation::WorldOptions world;
  load(world, {{file}, {}, {}});
  Json contents = of_configuration(world, "simulated world");
  contents["robots"] = world.robots.size();
  return contents;
}

Json of_lines(const fs::path& file, const char* kind) {
  Json lines = Json::array();
  std::istringstream text(read_file(file));
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return {{"kind", kind}, {"lines", lines}};
}

// A grid's is read elsewhere: it has an image.
std::optional<Json> of_yaml(const fs::path& file) {
  std::istringstream text(read_file(file));
  for (std::string line; std::getline(text, line);)
    for (const char* key : {"image:", "resolution:", "origin:"})
      if (line.compare(0, std::string(key).size(), key) == 0) return std::nullopt;
  if (file.filename() == "camera.yaml") return of_lines(file, "calibration of a camera");
  try {
    return of_run(file);
  } catch (const Error& no_run) {
    try {
      return of_world(file);
    } catch (const Error&) {
      throw no_run;
    }
  }
}

}  // namespace

std::optional<Json> contents_of_file(const fs::path& file) {
  using Reader = std::function<std::optional<Json>(const fs::path&)>;
  static const std::vector<std::pair<std::string, Reader>> readers = {
      {".tum", of_trajectory}, {".csv", of_csv},  {".txt", of_text},          {".relations", of_relations},
      {".g2o", of_graph},      {".pcd", of_pcd},  {".ply", of_ply},           {".bt", of_octomap},
      {".ot", of_octomap},     {".png", of_png},  {".pgm", of_pgm},           {".html", of_page},
      {".yaml", of_yaml},      {".yml", of_yaml}, {".txt.gz", of_vocabulary}, {".yml.gz", of_vocabulary}};
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return std::nullopt;
  const std::string name = file.filename().string();
  for (const auto& [ending, read] : readers)
    if (name.size() > ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0)
      return read(file);
  return std::nullopt;
}

}  // namespace mapweave::app
