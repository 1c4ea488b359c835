#include "reported_pair.h"

#include <mapweave/core/error.h>
#include <mapweave/maps/reasons.h>

#include <cmath>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;

Reason reason_of(const std::string& text) {
  for (int i = 0; i <= static_cast<int>(kLastReason); ++i)
    if (to_text(static_cast<Reason>(i)) == text) return static_cast<Reason>(i);
  return Reason::none;
}

Sense sense_of(const std::string& text) {
  for (const Sense sense : {Sense::grids, Sense::cameras})
    if (to_text(sense) == text) return sense;
  return Sense::lasers;
}

// Results of versions that did not write the line.
std::string words_of(const Json& verdict, const ReportedPair& pair) {
  if (const auto words = verdict.find("words"); words != verdict.end()) return words->get<std::string>();
  const std::string decision = pair.is_accepted                                          ? "merged"
                               : verdict.at("decision").get<std::string>() == "deferred" ? "not decided"
                                                                                         : "kept apart";
  return pair.a + " + " + pair.b + ": " + decision +
         (pair.reason == Reason::none ? "" : ": " + std::string(in_words(pair.reason)));
}

}  // namespace

std::optional<ReportedTransform> reported_transform(const Json& b_from_a) {
  constexpr double kFarthest_m = 1e5, kLargest = 100.0;
  if (!b_from_a.is_object()) return std::nullopt;
  Sim3 transform;
  transform.scale = b_from_a.value("scale", 1.0);
  if (b_from_a.contains("yaw")) {
    transform.pose = spatial(
        Pose2{b_from_a.at("x").get<double>(), b_from_a.at("y").get<double>(), b_from_a.at("yaw").get<double>()});
  } else {
    const auto t = b_from_a.at("t").get<std::vector<double>>(), q = b_from_a.at("q").get<std::vector<double>>();
    if (t.size() != 3 || q.size() != 4) return std::nullopt;
    transform.pose = {{t[0], t[1], t[2]}, Eigen::Quaterniond(q[3], q[0], q[1], q[2])};
  }
  const double length = transform.pose.q.norm();
  if (!(transform.scale > 1.0 / kLargest && transform.scale < kLargest && length > 0.5 && length < 2.0))
    return std::nullopt;
  transform.pose.q.normalize();
  const Sim3 a_from_b = inverse(transform);
  if (!(a_from_b.pose.t.norm() < kFarthest_m)) return std::nullopt;
  return ReportedTransform{planar(a_from_b.pose), a_from_b.scale};
}

ReportedPair reported_pair(const Json& verdict) {
  ReportedPair pair;
  pair.a = verdict.at("a").get<std::string>();
  pair.b = verdict.at("b").get<std::string>();
  pair.kind = verdict.value("kind", std::string());
  pair.reason = reason_of(verdict.at("reason").get<std::string>());
  pair.is_accepted = verdict.at("accepted").get<bool>();
  pair.words = words_of(verdict, pair);
  pair.is_in_one_map = verdict.value("in_one_map", false);
  if (const auto pose = verdict.find("team_b_from_a"); pose != verdict.end()) pair.in_team = reported_transform(*pose);
  if (const auto list = verdict.find("hypotheses"); list != verdict.end() && list->is_array())
    for (const Json& numbers : *list) {
      const auto pose = numbers.find("b_from_a");
      const auto transform = pose == numbers.end() ? std::nullopt : reported_transform(*pose);
      if (!transform || pair.hypotheses.size() == kMostPanels) continue;
      pair.hypotheses.push_back({*transform, sense_of(numbers.value("sense", std::string())), numbers});
    }
  pair.verdict = verdict;
  return pair;
}

}  // namespace mapweave::runtime
