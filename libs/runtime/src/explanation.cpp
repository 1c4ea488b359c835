#include <mapweave/runtime/explanation.h>

#include "verdict_text.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/format.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/exporters/hypothesis_sheet.h>
#include <mapweave/fusion/wall_weights.h>
#include <mapweave/maps/reasons.h>
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

constexpr std::size_t kMostPanels = 4;

double degrees(double radians) { return radians * 180.0 / M_PI; }

// Near enough to be drawn; false for what is no number.
bool is_near(const Pose2& pose) {
  constexpr double kFarthest_m = 1e5;
  return std::hypot(pose.x, pose.y) < kFarthest_m && std::abs(pose.phi) < kFarthest_m;
}

// Planar, as merges.json has it: of b's frame in a's.
std::optional<Pose2> a_from_b_of(const Json& holder) {
  const auto pose = holder.find("b_from_a");
  if (pose == holder.end() || !pose->is_object() || !pose->contains("yaw")) return std::nullopt;
  const Pose2 b_from_a{pose->at("x").get<double>(), pose->at("y").get<double>(), pose->at("yaw").get<double>()};
  return is_near(b_from_a) ? std::optional(inverse(b_from_a)) : std::nullopt;
}

Reason reason_of(const std::string& text) {
  for (int i = 0; i <= static_cast<int>(kLastReason); ++i)
    if (to_text(static_cast<Reason>(i)) == text) return static_cast<Reason>(i);
  return Reason::none;
}

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
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  for (const std::string& name : {one, other}) {
    if (names.count(name) != 0) continue;
    const auto nearest = nearest_name(name, {names.begin(), names.end()});
    throw Error(ErrorCode::kUsage, "unknown map '" + name + "'; there are: " + list, file.string(),
                nearest ? "did you mean '" + *nearest + "'?" : "name two of these");
  }
  throw Error(ErrorCode::kUsage, "nothing is said of '" + one + "' and '" + other + "'", file.string(), "name two maps that were compared");
}

// A robot's own map, from the team that it is in, else from its own folder.
std::optional<Map> own_map(const fs::path& results, const std::string& name) {
  std::error_code ignored;
  const fs::path own = results / "robots" / name / "map.mwdb";
  if (fs::exists(own, ignored)) {
    MapInput input = read_map_input(own, MapId(name));
    if (!input.maps.empty() && !input.maps.front().submaps.empty()) return std::move(input.maps.front());
  }
  for (int i = 0;; ++i) {
    const fs::path team = results / (i == 0 ? std::string("team") : "team-" + std::to_string(i)) / "map.mwdb";
    if (!fs::exists(team, ignored)) return std::nullopt;
    for (Map& map : read_map_input(team, MapId(name)).members)
      if (map.id.str() == name) return std::move(map);
  }
}

struct Hypothesis {
  Pose2 a_from_b;
  Json numbers;
  double of(const char* key) const { return numbers.value(key, 0.0); }
  // A team had the maps so until its audit took them apart; how unusual is what fits was not weighed.
  bool is_taken_apart() const { return of("coinciding_m") > 0.0 && of("distinctive_m") == 0.0 && of("overlap") == 0.0; }
  double fit_m() const { return fusion::fit_m(of("coinciding_m"), of("unclear_m"), of("contradicted_m")); }
};

std::string text_of(const Hypothesis& hypothesis, std::size_t number, const std::string& a, const std::string& b) {
  const Pose2& pose = hypothesis.a_from_b;
  std::string text = format("  %zu. %s began at x %.2f m, y %.2f m, yaw %.1f degrees of %s's map\n", number, b.c_str(), pose.x, pose.y,
                            degrees(pose.phi), a.c_str());
  text += format("     for it:     %.1f m of wall coincide, ", hypothesis.of("coinciding_m"));
  if (!hypothesis.is_taken_apart()) text += format("%.1f m of them fit nowhere around; ", hypothesis.of("distinctive_m"));
  text += format("%d places agree\n", static_cast<int>(hypothesis.of("matches")));
  text += format("     against it: %.1f m of wall were seen through, %.1f m are unclear", hypothesis.of("contradicted_m"), hypothesis.of("unclear_m"));
  const Json& places = hypothesis.numbers.at("contradictions");
  if (!places.empty())
    text += format("; the longest, %.1f m, at x %.1f m, y %.1f m of %s's map", places[0].at("length_m").get<double>(),
                   places[0].at("x_m").get<double>(), places[0].at("y_m").get<double>(), a.c_str());
  text += hypothesis.is_taken_apart() ? "\n     merged so at first, and taken apart by the audit of the team's map"
                                      : format("\n     overlap %.0f %%, probability by itself %.2f", 100.0 * hypothesis.of("overlap"),
                                               hypothesis.of("probability"));
  if (const double prior = hypothesis.of("prior_log_odds"); prior != 0.0) text += format("; the prior adds %+.1f to its log odds", prior);
  return text + "\n";
}

std::string rivals_in_words(const std::vector<Hypothesis>& hypotheses) {
  std::string text;
  for (std::size_t i = 1; i < hypotheses.size(); ++i) {
    if (hypotheses[0].fit_m() <= 0.0) break;
    const double share = hypotheses[i].fit_m() / hypotheses[0].fit_m();
    if (share > 0.0) text += format("rival: hypothesis %zu lays %.0f %% as much wall on wall as hypothesis 1\n", i + 1, 100.0 * share);
  }
  return text;
}

std::string page(const Json& verdict, const std::vector<Hypothesis>& hypotheses, const std::string& a, const std::string& b) {
  const Reason reason = reason_of(verdict.at("reason").get<std::string>());
  const bool is_accepted = verdict.at("accepted").get<bool>();
  std::string text = a + " + " + b + ": ";
  text += is_accepted ? "merged" : verdict.at("decision").get<std::string>() == "deferred" ? "not decided" : "kept apart";
  if (reason != Reason::none) text += ": " + std::string(in_words(reason));
  text += " (" + std::string(to_text(reason)) + "; " +
          numbers_in_words(verdict.value("probability", 0.0), verdict.value("overlap", 0.0), verdict.value("conflict", 0.0)) + ")\n";
  if (hypotheses.empty())
    text += "no hypothesis: no place of both was found that fits\n";
  else
    text += hypotheses.size() == 1 ? "the hypothesis there was:\n" : format("the %zu most probable hypotheses:\n", hypotheses.size());
  for (std::size_t i = 0; i < hypotheses.size(); ++i) text += text_of(hypotheses[i], i + 1, a, b);
  text += rivals_in_words(hypotheses);
  if (const auto prior = verdict.find("prior"); prior != verdict.end() && prior->is_object())
    text += "prior: " + prior->at("because").get<std::string>() + "\n";
  if (const std::string_view help = what_helps(reason); !help.empty()) text += "what helps: " + std::string(help) + "\n";
  return text;
}

// Beside each other, where nothing says how they lie.
exporters::HypothesisPanel apart(const OccupancyGrid& a, const OccupancyGrid& b) {
  constexpr double kGap_m = 2.0;
  const double right = a.origin_x_m + a.columns * a.resolution_m;
  return {{right + kGap_m - b.origin_x_m, 0.0, 0.0}, {"no hypothesis: the maps beside each other"}, {}};
}

// Where a prior puts the maps, unless they agree with it.
std::optional<exporters::HypothesisPanel> panel_of_prior(const Json& verdict) {
  const auto prior = verdict.find("prior");
  if (prior == verdict.end() || !prior->is_object() || !prior->at("contradicted").get<bool>()) return std::nullopt;
  const Json& pose = prior->at("a_from_b");
  const Pose2 a_from_b{pose.at("x").get<double>(), pose.at("y").get<double>(), pose.at("yaw").get<double>()};
  if (!is_near(a_from_b)) return std::nullopt;
  return exporters::HypothesisPanel{
      a_from_b,
      {"as the prior puts them, which is contradicted",
       format("%.1f m of wall coincide, %.1f m were seen through", prior->value("coinciding_m", 0.0), prior->value("contradicted_m", 0.0))},
      {}};
}

std::string picture(const Json& verdict, const std::vector<Hypothesis>& hypotheses, const OccupancyGrid& a, const OccupancyGrid& b,
                    const Explanation& of) {
  std::vector<exporters::HypothesisPanel> panels;
  for (const Hypothesis& hypothesis : hypotheses) {
    exporters::HypothesisPanel panel;
    panel.a_from_b = hypothesis.a_from_b;
    if (hypothesis.is_taken_apart())
      panel.caption = {format("%zu. merged so at first, and taken apart by the audit", panels.size() + 1),
                       format("for it: %.1f m of wall coincide, %d places agree", hypothesis.of("coinciding_m"), static_cast<int>(hypothesis.of("matches"))),
                       format("against it: %.1f m seen through, %.1f m unclear", hypothesis.of("contradicted_m"), hypothesis.of("unclear_m"))};
    else
      panel.caption = {format("%zu. probability by itself %.2f, overlap %.0f %%, %d places agree", panels.size() + 1, hypothesis.of("probability"),
                            100.0 * hypothesis.of("overlap"), static_cast<int>(hypothesis.of("matches"))),
                     format("for it: %.1f m of wall coincide, %.1f m fit nowhere around", hypothesis.of("coinciding_m"), hypothesis.of("distinctive_m")),
                     format("against it: %.1f m seen through, %.1f m unclear", hypothesis.of("contradicted_m"), hypothesis.of("unclear_m"))};
    for (const Json& place : hypothesis.numbers.at("contradictions"))
      panel.rings.push_back({place.at("x_m").get<double>(), place.at("y_m").get<double>(), std::max(0.5, 0.5 * place.at("length_m").get<double>())});
    panels.push_back(std::move(panel));
  }
  if (auto prior = panel_of_prior(verdict); prior && panels.size() < kMostPanels) panels.push_back(std::move(*prior));
  if (panels.empty()) panels.push_back(apart(a, b));
  return exporters::hypothesis_sheet_png(a, b, panels, of.text.substr(0, of.text.find('\n')), of.a, of.b);
}

}  // namespace

Explanation explain(const fs::path& results, const std::string& one, const std::string& other, const fusion::ComposeOptions& options,
                    WorkerPool& pool) {
  const fs::path file = results / "merges.json";
  std::error_code ignored;
  if (!fs::exists(file, ignored))
    throw Error(ErrorCode::kMissing, "there is no merges.json", results.string(), "name a folder of results of mapweave run or merge");
  Explanation result;
  std::vector<Hypothesis> hypotheses;
  Json verdict;
  try {
    verdict = verdict_of(Json::parse(read_file(file)), one, other, file);
    result.a = verdict.at("a").get<std::string>();
    result.b = verdict.at("b").get<std::string>();
    if (!is_valid_name(result.a) || !is_valid_name(result.b)) throw Error(ErrorCode::kCorrupt, "it has names that are none", file.string());
    if (const auto list = verdict.find("hypotheses"); list != verdict.end() && list->is_array())
      for (const Json& numbers : *list)
        if (const auto pose = a_from_b_of(numbers); pose && hypotheses.size() < kMostPanels) hypotheses.push_back({*pose, numbers});
    result.text = page(verdict, hypotheses, result.a, result.b);
  } catch (const Json::exception& error) {
    throw Error(ErrorCode::kCorrupt, error.what(), file.string(), "make the results again");
  }
  const auto a = own_map(results, result.a), b = own_map(results, result.b);
  if (!a || !b) return result;
  const OccupancyGrid grid_a = fusion::compose_grid(*a, options, pool), grid_b = fusion::compose_grid(*b, options, pool);
  if (grid_a.empty() || grid_b.empty()) return result;
  try {
    result.png = picture(verdict, hypotheses, grid_a, grid_b, result);
  } catch (const Json::exception& error) {
    throw Error(ErrorCode::kCorrupt, error.what(), file.string(), "make the results again");
  }
  return result;
}

}  // namespace mapweave::runtime
