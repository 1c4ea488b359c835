#include <mapweave/report/report_page.h>

#include "map_data.h"
#include "option_differences.h"
#include "page_text.h"
#include "pair_data.h"
#include "reference_errors.h"
#include "run_data.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/log.h>

#include <opencv2/imgcodecs.hpp>

#include <algorithm>

namespace mapweave::report {
namespace {

constexpr std::size_t kMostPictureBytes = 24'000'000;  // of frames.png together, so that the page opens at once

// As JPEG, which is a fifth as large; empty for what cannot be decoded.
std::string as_jpeg(const std::string& png) {
  const std::vector<unsigned char> bytes(png.begin(), png.end());
  try {
    const cv::Mat image = cv::imdecode(bytes, cv::IMREAD_COLOR);
    if (image.empty()) return {};
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", image, jpeg, {cv::IMWRITE_JPEG_QUALITY, 80});
    return {jpeg.begin(), jpeg.end()};
  } catch (const cv::Exception&) {  // a size that nobody draws
    return {};
  }
}

// What cameras saw, with the landmarks that were tracked.
Json pictures_json(ResultFiles& files, const std::vector<ReportMap>& maps) {
  Json pictures = Json::array();
  std::size_t total = 0;
  const auto add = [&](const std::string& file, const std::string& title) {
    if (!files.has(file)) return;
    files.attempt(file, [&] {
      const std::string jpeg = as_jpeg(read_file(files.path(file), 1 << 26));
      if (jpeg.empty()) throw Error(ErrorCode::kCorrupt, "it is no picture");
      if (total + jpeg.size() > kMostPictureBytes)
        throw Error(ErrorCode::kBadInput, "it is not in this page, which has enough pictures");
      total += jpeg.size();
      pictures.push_back({{"title", title}, {"image", data_url("jpeg", jpeg)}});
    });
  };
  for (const ReportMap& map : maps) {
    const std::string prefix = map.folder.empty() ? "" : map.folder + "/";
    add(prefix + "frames.png", map.title + ": pictures, with the landmarks that were tracked");
    for (const std::string& camera : files.folders_in(prefix + "cameras"))
      add(prefix + "cameras/" + camera + "/frames.png", map.title + ", camera " + camera);
  }
  return pictures;
}

std::string text_of(const Json& json, const char* key) {
  const auto found = json.is_object() ? json.find(key) : json.end();
  return json.is_object() && found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

std::string title_of(const Json& manifest, const std::vector<std::string>& robots) {
  constexpr std::size_t kMostNamed = 5;
  const std::string verb = text_of(manifest, "verb");
  std::string title = "mapweave " + (verb.empty() ? "results" : verb);
  for (std::size_t i = 0; i < std::min(robots.size(), kMostNamed); ++i) title += (i == 0 ? ": " : ", ") + robots[i];
  if (robots.size() > kMostNamed) title += " and " + std::to_string(robots.size() - kMostNamed) + " more";
  return title;
}

// What `from` says of `key`, if it is of the kind that is expected.
void copy(const Json& from, Json& to, const char* key, const Json& otherwise) {
  const bool is_there = from.is_object() && from.contains(key);
  to[key] = is_there && from[key].type() == otherwise.type() ? from[key] : otherwise;
}

Json timeline_data(const Json& summary) {
  if (!summary.is_object() || !summary.contains("timeline")) return {};
  Json timeline = summary["timeline"];
  if (timeline.is_object()) timeline.erase("overlaps");
  return rounded(timeline, 4);
}

std::size_t bytes_of_pictures(const Json& json) {
  std::size_t bytes = 0;
  if (json.is_string() && json.get_ref<const std::string&>().compare(0, 11, "data:image/") == 0)
    bytes = json.get_ref<const std::string&>().size();
  if (json.is_structured())
    for (const Json& item : json) bytes += bytes_of_pictures(item);
  return bytes;
}

// What holds measured times is bounded by its length, so that how many points are shown does not depend on them.
std::size_t bytes_beside_poses(const std::string& title, Json data, const std::vector<ReportMap>& maps) {
  // More than what holds times takes; what is too much is lost to points.
  constexpr std::size_t kReserve = 20'000, kBytesOfRobot = 2000, kBytesOfStage = 150, kBytesOfDecision = 1000;
  std::size_t bytes = kReserve + kBytesOfRobot * data["robots"].size() + kBytesOfStage * data["stages"].size();
  if (data["coordinator"].is_object())
    bytes += (kBytesOfDecision + 40 * data["robots"].size()) * data["coordinator"].value("decisions", Json()).size();
  for (const char* timed : {"robots", "stages", "coordinator", "timeline", "summary"}) data.erase(timed);
  bytes += page_text(PageKind::run, title, data).size() - bytes_of_pictures(data);
  for (const ReportMap& map : maps) bytes += script_json(map.json).size() - bytes_of_pictures(map.json);
  return bytes;
}

}  // namespace

std::string report_page(const std::filesystem::path& results, const PageContext& context) {
  ResultFiles files(results);
  const Json manifest = files.json("manifest.json"), summary = files.json("summary.json");
  const bool has_none = text_of(manifest, "verb") == "slam" && !files.has("merges.json");  // it joined no other map
  const Json merges = has_none ? Json::array() : files.json("merges.json");
  std::vector<std::string> robots;
  std::vector<ReportMap> maps;
  files.attempt("summary.json", [&] { robots = robot_names(files, summary); });
  maps = read_maps(files, robots, summary, merges);
  if (maps.empty() && !files.has("manifest.json") && !files.has("summary.json"))
    throw Error(ErrorCode::kMissing, "this is no folder of results", results.string(),
                "name a folder that mapweave run, slam or merge has written");
  const ReferenceErrors reference = reference_errors(context.reference, robots, maps);

  Json data = {{"verb", ""}, {"versions", Json::object()}, {"inputs", Json::array()}, {"seed", nullptr}};
  data["verb"] = text_of(manifest, "verb");
  copy(manifest, data, "versions", Json::object());
  copy(manifest, data, "inputs", Json::array());
  if (manifest.is_object() && manifest.contains("seed") && manifest["seed"].is_number())
    data["seed"] = manifest["seed"];
  for (const char* part : {"robots", "pairs", "options", "commands"}) data[part] = Json::array();
  files.attempt("summary.json", [&] { data["robots"] = robots_json(robots, summary); });
  files.attempt("summary.json", [&] { data["summary"] = summary_data(summary); });
  files.attempt("merges.json", [&] { data["pairs"] = pairs_json(merges); });
  data["timeline"] = timeline_data(summary);
  copy(summary, data, "stages", Json::array());
  data["stages"] = rounded(data["stages"], 4);
  copy(summary, data, "coordinator", Json::object());
  if (!files.has("config.yaml"))
    files.miss("config.yaml");
  else
    files.attempt("config.yaml", [&] {
      data["options"] =
          option_differences(read_file(files.path("config.yaml"), 1 << 24), context.default_options, "config.yaml");
    });
  files.attempt("manifest.json", [&] { data["commands"] = commands(manifest, data["options"]); });
  data["errors"] = rounded(reference.errors, 5);
  data["alignment"] = reference.alignment;
  data["pictures"] = pictures_json(files, maps);
  data["missing"] = files.missing();
  data["problems"] = files.problems();
  for (const std::string& problem : files.problems())
    log(LogLevel::warning, "the page lacks a part of " + results.string() + ": " + problem);
  const std::string title = title_of(manifest, robots);
  data["maps"] = maps_json(maps, kMostPageBytes - std::min(kMostPageBytes, bytes_beside_poses(title, data, maps)));
  return page_text(PageKind::run, title, data);
}

}  // namespace mapweave::report
