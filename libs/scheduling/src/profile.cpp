#include <mapweave/scheduling/profile.h>

#include "json_fields.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/ids.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <map>
#include <system_error>

namespace mapweave::scheduling {
namespace {

using Json = nlohmann::json;
constexpr double kMost = 1e12;

struct Samples {
  std::vector<std::pair<double, double>> slam_s, map_bytes;          // by scans
  std::vector<std::pair<double, double>> edge_fusion, cloud_fusion;  // seconds by maps
  double scans = 0.0, robots = 0.0;
};

const Json& list(const Json& root, const char* name, const std::string& where) {
  const Json& value = member(root, name, where, "");
  if (!value.is_array()) refuse("a list was expected", where, name, "is this the summary of `mapweave run`?");
  return value;
}

double field(const Json& object, const char* name, const std::string& where, const std::string& key) {
  if (!object.is_object()) refuse("an object was expected", where, key, "");
  return number(member(object, name, where, key), 0.0, kMost, false, where, key + "." + name);
}

std::string text(const Json& object, const char* name, const std::string& where, const std::string& key) {
  if (!object.is_object()) refuse("an object was expected", where, key, "");
  const Json& value = member(object, name, where, key);
  if (!value.is_string()) refuse("a text was expected", where, key + "." + name, "");
  return value.get<std::string>();
}

void add_run(const std::filesystem::path& folder, Samples& samples) {
  const std::filesystem::path path = folder / "summary.json";
  constexpr std::uint64_t kMostBytes = 1 << 26;
  const std::string where = path.string();
  const Json root = parse_json(read_file(path, kMostBytes), where);
  if (!root.is_object()) refuse("an object was expected", where, "", "");
  std::map<std::string, double> maps_at;
  for (const Json& robot : list(root, "robots", where)) {
    const double scans = field(robot, "scans", where, "robots");
    const Json& mapped = member(robot, "mapped", where, "robots");
    if (!mapped.is_boolean() || !mapped.get<bool>() || scans == 0.0) continue;
    samples.slam_s.emplace_back(scans, field(robot, "cpu_seconds", where, "robots"));
    samples.scans += scans;
    samples.robots += 1.0;
    const std::string id = name(member(robot, "id", where, "robots"), where, "robots.id");
    std::error_code none;
    const auto bytes = std::filesystem::file_size(folder / "robots" / id / "map.mwdb", none);
    if (!none) samples.map_bytes.emplace_back(scans, static_cast<double>(bytes));
    if (robot.contains("edge")) maps_at[text(robot, "edge", where, "robots")] += 1.0;
  }
  std::map<std::string, double> seconds_at;
  for (const Json& stage : list(root, "stages", where)) {
    static const char* const kFusion[] = {"features", "pairwise matching", "component connection", "transform optimisation", "composing"};
    const std::string what = text(stage, "name", where, "stages");
    if (std::find(std::begin(kFusion), std::end(kFusion), what) != std::end(kFusion))
      seconds_at[text(stage, "tier", where, "stages")] += field(stage, "seconds", where, "stages");
  }
  for (const auto& [tier, seconds] : seconds_at) {
    if (const auto maps = maps_at.find(tier); maps != maps_at.end())
      samples.edge_fusion.emplace_back(maps->second, seconds);
    else if (!maps_at.empty())
      samples.cloud_fusion.emplace_back(static_cast<double>(maps_at.size()), seconds);
  }
}

// Fits seconds (or bytes) to the functions of `basis`, and tells a few predictions.
template <class Basis>
Regression fitted(const std::string& name, const std::string& by, const std::string& unit,
                  const std::vector<std::pair<double, double>>& samples, Basis basis, Profile& profile) {
  const std::size_t columns = basis(0.0).size();
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(samples.size()), static_cast<Eigen::Index>(columns));
  Eigen::VectorXd measured(static_cast<Eigen::Index>(samples.size()));
  double least = samples.front().first, most = least;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::vector<double> row = basis(samples[i].first);
    for (std::size_t k = 0; k < columns; ++k) rows(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = row[k];
    measured[static_cast<Eigen::Index>(i)] = samples[i].second;
    least = std::min(least, samples[i].first);
    most = std::max(most, samples[i].first);
  }
  ProfiledTerm term{name, by, unit, fit(rows, measured), {}};
  for (const double at : {least, 0.5 * (least + most), most})
    if (term.shown.empty() || at > term.shown.back().at)
      term.shown.push_back({at, term.regression.at(basis(at)), term.regression.interval(basis(at))});
  profile.terms.push_back(term);
  return term.regression;
}

}  // namespace

Profile profile_runs(const std::vector<std::filesystem::path>& folders) {
  Samples samples;
  for (const auto& folder : folders) add_run(folder, samples);
  Profile profile;
  LatencyModel& model = profile.model;
  const auto missing = [&](const char* what) {
    profile.notes.push_back(std::string(what) + " is not told by these runs: its default stands");
  };
  if (samples.robots > 0.0) {
    model.scans = samples.scans / samples.robots;
    // Packing is measured within it: logs are read and packed where they are mapped.
    model.slam_s_per_scan = fitted(
                                "SLAM", "scans", "s", samples.slam_s, [](double scans) { return std::vector<double>{scans}; }, profile)
                                .coefficients[0];
  } else {
    missing("SLAM");
  }
  if (!samples.map_bytes.empty()) {
    const Regression bytes = fitted(
        "size of a robot's map", "scans", "bytes", samples.map_bytes,
        [](double scans) {
          return std::vector<double>{1.0, scans};
        },
        profile);
    model.map_bytes_fixed = bytes.coefficients[0];
    model.map_bytes_per_scan = bytes.coefficients[1];
  } else {
    missing("the size of maps");
  }
  const auto fusion = [&](const char* what, const std::vector<std::pair<double, double>>& seconds, FusionTime& time) {
    if (seconds.empty()) return missing(what);
    const Regression found = fitted(
        what, "maps", "s", seconds,
        [](double maps) {
          return std::vector<double>{1.0, maps, 0.5 * maps * (maps - 1.0)};
        },
        profile);
    time = {found.coefficients[0], found.coefficients[1], found.coefficients[2]};
  };
  fusion("fusion on an edge", samples.edge_fusion, model.edge_fusion);
  fusion("fusion in the cloud", samples.cloud_fusion, model.cloud_fusion);
  return profile;
}

}  // namespace mapweave::scheduling
