#pragma once
// What merges.json reports of one pair of maps, read back to be explained.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/judgement.h>

#include <nlohmann/json.hpp>

#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

constexpr std::size_t kMostPanels = 4;

// As seen from above.
struct ReportedTransform {
  Pose2 a_from_b;
  double scale = 1.0;
};

struct ReportedHypothesis {
  ReportedTransform transform;
  Sense sense = Sense::lasers;
  nlohmann::ordered_json numbers;
  double of(const char* key) const { return numbers.value(key, 0.0); }
  bool is(const char* key) const { return numbers.value(key, false); }
  const nlohmann::ordered_json& contradictions() const { return numbers.at("contradictions"); }
};

struct ReportedPair {
  std::string a, b, kind, words;
  Reason reason = Reason::none;
  bool is_accepted = false, is_in_one_map = false;
  std::optional<ReportedTransform> in_team;  // where they lie in one map
  std::vector<ReportedHypothesis> hypotheses;
  nlohmann::ordered_json verdict;
  // In one map through others alone: what the pair's own hypotheses say is not how they lie.
  bool is_through_others() const { return is_in_one_map && !is_accepted; }
};

// Throws nlohmann's exceptions for what is no verdict.
ReportedPair reported_pair(const nlohmann::ordered_json& verdict);

// Of one map in another; near enough to be drawn, else nothing.
std::optional<ReportedTransform> reported_transform(const nlohmann::ordered_json& b_from_a);

// A page: the decision, each hypothesis with what speaks for and against it, what would help. `rasters`: what is odd
// about the maps' rasters, a line each.
std::string page(const ReportedPair& pair, const std::vector<std::string>& rasters);

// Lines under a picture of it.
std::vector<std::string> caption(const ReportedHypothesis& hypothesis, std::size_t number, const ReportedPair& pair);

}  // namespace mapweave::runtime
