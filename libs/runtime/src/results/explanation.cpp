#include <mapweave/runtime/explanation.h>

#include "reported_pair.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/format.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/exporters/hypothesis_sheet.h>
#include <mapweave/exporters/point_cloud.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/fusion/raster_doubt.h>
#include <mapweave/runtime/map_input.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// The last tier's verdict of the two.
Json verdict_of(const Json& merges, const std::string& one, const std::string& other, const fs::path& file) {
  const Json* found = nullptr;
  std::set<std::string> names;
  for (const Json& verdict : merges) {
    const std::string a = verdict.at("a").get<std::string>(), b = verdict.at("b").get<std::string>();
    names.insert({a, b});
    if ((a == one && b == other) || (a == other && b == one)) found = &verdict;
  }
  if (found != nullptr) return *found;
  if (names.empty())
    throw Error(ErrorCode::kUsage, "no two maps were compared: there is nothing to explain", file.string(),
                "merge the maps: mapweave merge");
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  for (const std::string& name : {one, other}) {
    if (names.count(name) != 0) continue;
    const auto nearest = nearest_name(name, {names.begin(), names.end()});
    throw Error(ErrorCode::kUsage, "unknown map '" + name + "'; there are: " + list, file.string(),
                nearest ? "did you mean '" + *nearest + "'?" : "name two of these");
  }
  throw Error(ErrorCode::kUsage, "nothing is said of '" + one + "' and '" + other + "'", file.string(),
              "name two maps that were compared");
}

// A robot's own map, from the team that it is in, else from its own folder.
std::optional<Map> own_map(const fs::path& results, const std::string& name) {
  std::error_code ignored;
  const fs::path own = results / "robots" / name / "map.mwdb";
  if (fs::exists(own, ignored)) {
    MapInput input = read_map_input(own, MapId(name));
    const bool has_content =
        !input.maps.empty() && !(input.maps.front().submaps.empty() && input.maps.front().landmarks.empty());
    if (has_content) return std::move(input.maps.front());
  }
  for (const fs::path& team : team_folders(results))
    for (Map& map : read_map_input(team / "map.mwdb", MapId(name)).members)
      if (map.id.str() == name) return std::move(map);
  return std::nullopt;
}

// Landmarks of cameras as walls, seen from above; of a map with far outliers what most of them lie in.
OccupancyGrid grid_of_landmarks(const Map& map) {
  constexpr double kCell_m = 0.05, kLeft_out = 0.02;  // the share of points, at each side, that may be far outliers
  constexpr int kMostCells = 2000;                    // across: bounds the picture
  const std::vector<exporters::ColouredPoint> points = exporters::landmark_cloud(map);
  OccupancyGrid grid;
  if (points.empty()) return grid;
  double low[2], high[2];
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> values;
    for (const exporters::ColouredPoint& point : points) values.push_back(point.point(axis));
    std::sort(values.begin(), values.end());
    const auto left_out = static_cast<std::size_t>(kLeft_out * static_cast<double>(values.size() - 1));
    low[axis] = values[left_out];
    high[axis] = values[values.size() - 1 - left_out];
  }
  const double side_m = std::max(high[0] - low[0], high[1] - low[1]);
  if (!std::isfinite(side_m)) return grid;
  grid.resolution_m = std::max(kCell_m, side_m / kMostCells);
  grid.origin_x_m = low[0];
  grid.origin_y_m = low[1];
  grid.columns = static_cast<std::int32_t>((high[0] - low[0]) / grid.resolution_m) + 1;
  grid.rows = static_cast<std::int32_t>((high[1] - low[1]) / grid.resolution_m) + 1;
  grid.log_odds.assign(static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows),
                       OccupancyGrid::kUnknown);
  for (const exporters::ColouredPoint& point : points) {
    const double x = point.point.x(), y = point.point.y();
    if (x < low[0] || x > high[0] || y < low[1] || y > high[1]) continue;
    const auto column = static_cast<std::size_t>((x - low[0]) / grid.resolution_m),
               row = static_cast<std::size_t>((y - low[1]) / grid.resolution_m);
    grid.log_odds[row * static_cast<std::size_t>(grid.columns) + column] =
        static_cast<std::int16_t>(OccupancyGrid::kUnitsPerNat);
  }
  return grid;
}

OccupancyGrid drawn(const Map& map, const fusion::ComposeOptions& options, WorkerPool& pool) {
  OccupancyGrid grid = fusion::compose_grid(map, options, pool);
  return grid.empty() ? grid_of_landmarks(map) : grid;
}

// Beside each other, where nothing says how they lie.
exporters::HypothesisPanel apart(const OccupancyGrid& a, const OccupancyGrid& b) {
  constexpr double kGap_m = 2.0;
  const double right = a.origin_x_m + a.columns * a.resolution_m;
  exporters::HypothesisPanel panel;
  panel.a_from_b = {right + kGap_m - b.origin_x_m, 0.0, 0.0};
  panel.caption = {"no hypothesis: the maps beside each other"};
  return panel;
}

exporters::HypothesisPanel panel_at(const ReportedTransform& transform, std::vector<std::string> caption) {
  exporters::HypothesisPanel panel;
  panel.a_from_b = transform.a_from_b;
  panel.scale = transform.scale;
  panel.caption = std::move(caption);
  return panel;
}

// Where a prior puts the maps, unless they agree with it.
std::optional<exporters::HypothesisPanel> panel_of_prior(const Json& verdict) {
  constexpr double kFarthest_m = 1e5;  // beyond, what is in the file cannot be drawn
  const auto prior = verdict.find("prior");
  if (prior == verdict.end() || !prior->is_object() || !prior->at("contradicted").get<bool>()) return std::nullopt;
  const Json& pose = prior->at("a_from_b");
  const Pose2 a_from_b{pose.at("x").get<double>(), pose.at("y").get<double>(), pose.at("yaw").get<double>()};
  if (!(std::hypot(a_from_b.x, a_from_b.y) < kFarthest_m && std::abs(a_from_b.phi) < kFarthest_m)) return std::nullopt;
  return panel_at({a_from_b, 1.0}, {"as the prior puts them, which is contradicted",
                                    format("%.1f m of wall coincide, %.1f m were seen through",
                                           prior->value("coinciding_m", 0.0), prior->value("contradicted_m", 0.0))});
}

std::string picture(const ReportedPair& pair, const OccupancyGrid& a, const OccupancyGrid& b) {
  std::vector<exporters::HypothesisPanel> panels;
  if (pair.is_through_others() && pair.in_team)
    panels.push_back(panel_at(*pair.in_team, {"as they lie in the team's map, through other maps"}));
  for (std::size_t i = 0; i < pair.hypotheses.size(); ++i) {
    const ReportedHypothesis& hypothesis = pair.hypotheses[i];
    exporters::HypothesisPanel panel = panel_at(hypothesis.transform, caption(hypothesis, i + 1, pair));
    for (const Json& place : hypothesis.contradictions())
      panel.rings.push_back({place.at("x_m").get<double>(), place.at("y_m").get<double>(),
                             std::max(0.5, 0.5 * place.at("length_m").get<double>())});
    panels.push_back(std::move(panel));
  }
  if (auto prior = panel_of_prior(pair.verdict); prior && panels.size() < kMostPanels)
    panels.push_back(std::move(*prior));
  if (panels.empty()) panels.push_back(apart(a, b));
  return exporters::hypothesis_sheet_png(a, b, panels, pair.words.substr(0, pair.words.find(" (")), pair.a, pair.b);
}

// What is odd about grids of other makers.
std::vector<std::string> raster_notes(const std::vector<const Map*>& maps) {
  std::vector<std::string> notes;
  for (const Map* map : maps) {
    if (!fusion::is_grid(*map)) continue;
    const std::string doubt = fusion::doubt_of_raster(fusion::grid_of_map(*map));
    if (!doubt.empty()) notes.push_back(map->id.str() + " " + doubt);
  }
  return notes;
}

}  // namespace

Explanation explain(const fs::path& results, const std::string& one, const std::string& other,
                    const fusion::ComposeOptions& options, WorkerPool& pool) {
  const fs::path file = results / "merges.json";
  std::error_code ignored;
  if (!fs::exists(file, ignored))
    throw Error(ErrorCode::kMissing, "there is no merges.json", results.string(),
                "name a folder of results of mapweave run or merge");
  Explanation result;
  try {
    const ReportedPair pair = reported_pair(verdict_of(Json::parse(read_file(file)), one, other, file));
    result.a = pair.a;
    result.b = pair.b;
    if (!is_valid_name(result.a) || !is_valid_name(result.b))
      throw Error(ErrorCode::kCorrupt, "it has names that are none", file.string());
    const auto a = own_map(results, result.a), b = own_map(results, result.b);
    if (!a || !b) {
      result.text = page(pair, {});
      return result;
    }
    result.text = page(pair, raster_notes({&*a, &*b}));
    const OccupancyGrid grid_a = drawn(*a, options, pool), grid_b = drawn(*b, options, pool);
    if (!grid_a.empty() && !grid_b.empty()) result.png = picture(pair, grid_a, grid_b);
  } catch (const Json::exception& error) {
    throw Error(ErrorCode::kCorrupt, error.what(), file.string(), "make the results again");
  }
  return result;
}

}  // namespace mapweave::runtime
