// Why two maps were merged or stayed apart, in words.

#include "reported_pair.h"

#include <mapweave/core/format.h>
#include <mapweave/fusion/wall_weights.h>
#include <mapweave/maps/reasons.h>

#include <algorithm>
#include <cmath>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;

int matches_of(const ReportedHypothesis& hypothesis) { return static_cast<int>(hypothesis.of("matches")); }

std::string where(const ReportedTransform& transform, Sense sense, const ReportedPair& pair) {
  const Pose2& pose = transform.a_from_b;
  std::string text = format("%s %s x %.2f m, y %.2f m, yaw %.1f degrees of %s's map", pair.b.c_str(),
                            sense == Sense::grids ? "has its origin at" : "began at", pose.x, pose.y,
                            pose.phi * 180.0 / M_PI, pair.a.c_str());
  if (std::abs(transform.scale - 1.0) > 1e-6) text += format(", scaled by %.3f", transform.scale);
  return text;
}

// The share of what fits that counts: less than all where rooms have other widths.
double share_of(const ReportedHypothesis& hypothesis) { return fusion::counted_share(hypothesis.of("wider_m")); }

// Walls of lasers whose evidence was weighed: else their sum says nothing.
bool is_weighed(const ReportedHypothesis& hypothesis) { return hypothesis.of("by_chance_m") > 0.0; }

std::string counted(int count, const char* one, const char* many) {
  return format("%d %s", count, count == 1 ? one : many);
}

std::string for_it(const ReportedHypothesis& hypothesis) {
  const double coinciding_m = hypothesis.of("coinciding_m");
  if (hypothesis.sense == Sense::cameras)
    return counted(matches_of(hypothesis), "pair of pictures shows", "pairs of pictures show") + " the same place so";
  if (hypothesis.sense == Sense::grids)
    return format("%.1f m of wall coincide, which count %.1f m: by how unusual it is, less what is against it",
                  coinciding_m, hypothesis.of("support_m"));
  std::string text = format("%.1f m of wall coincide, ", coinciding_m);
  if (is_weighed(hypothesis)) text += format("%.1f m of them fit nowhere around; ", hypothesis.of("distinctive_m"));
  return text + counted(matches_of(hypothesis), "place agrees", "places agree");
}

std::string against_it(const ReportedHypothesis& hypothesis, const ReportedPair& pair) {
  const double contradicted_m = hypothesis.of("contradicted_m");
  if (hypothesis.sense == Sense::cameras) {
    const int elsewhere = static_cast<int>(hypothesis.of("elsewhere"));
    return elsewhere == 0 ? "no pair of pictures puts them elsewhere"
                          : counted(elsewhere, "pair of pictures puts", "pairs of pictures put") + " them elsewhere";
  }
  if (hypothesis.sense == Sense::grids) return format("%.1f m of wall lie in free space of the other", contradicted_m);
  std::string text =
      format("%.1f m of wall were seen through, %.1f m are unclear", contradicted_m, hypothesis.of("unclear_m"));
  if (share_of(hypothesis) < 1.0)
    text +=
        format("; rooms of %s are at least %.0f cm wider", (hypothesis.of("wider_m") > 0.0 ? pair.b : pair.a).c_str(),
               100.0 * std::abs(hypothesis.of("wider_m")));
  return text;
}

// What the probability is made of, as the merge was decided by.
std::string sum_of(const ReportedHypothesis& hypothesis) {
  constexpr double kSurest = 20.0;
  if (hypothesis.sense != Sense::lasers || !is_weighed(hypothesis)) return "";
  const double distinctive_m = share_of(hypothesis) * hypothesis.of("distinctive_m");
  const double sum = distinctive_m - fusion::kContradictionWeight * hypothesis.of("contradicted_m") -
                     fusion::kUnclearWeight * hypothesis.of("counted_unclear_m") - hypothesis.of("by_chance_m");
  std::string text = format(
      "     the sum:    %.1f m that fit nowhere around%s - %.0f x %.1f m seen through - %.0f x %.1f m unclear%s - %.1f "
      "m "
      "expected by chance "
      "= %.1f",
      distinctive_m, share_of(hypothesis) < 1.0 ? " (not all, as rooms differ in width)" : "",
      fusion::kContradictionWeight, hypothesis.of("contradicted_m"), fusion::kUnclearWeight,
      hypothesis.of("counted_unclear_m"),
      hypothesis.of("counted_unclear_m") < hypothesis.of("unclear_m") - 0.05 ? " (the others lie where a view ends)"
                                                                             : "",
      hypothesis.of("by_chance_m"), sum);
  if (std::abs(sum) > kSurest) text += format(", which counts as %.0f", std::copysign(kSurest, sum));
  if (const double prior = hypothesis.of("prior_log_odds"); prior != 0.0)
    text += format("; the prior adds %+.1f", prior);
  return text + format("\n     log odds of %.1f are a probability of %.2f by itself\n", hypothesis.of("log_odds"),
                       hypothesis.of("probability"));
}

bool was_compared(const ReportedHypothesis& hypothesis) {
  return hypothesis.sense != Sense::lasers ||
         hypothesis.of("coinciding_m") + hypothesis.of("contradicted_m") + hypothesis.of("unclear_m") > 0.0;
}

std::string text_of(const ReportedHypothesis& hypothesis, std::size_t number, const ReportedPair& pair) {
  std::string text = format("  %zu. ", number) + where(hypothesis.transform, hypothesis.sense, pair) + "\n";
  if (hypothesis.is("of_teams")) text += "     the numbers are of all maps of the two teams that they were in\n";
  if (!was_compared(hypothesis))
    return text + format("     no walls were compared: %s so, but the maps cannot be bent to fit them\n",
                         counted(matches_of(hypothesis), "place matches", "places match").c_str());
  text += "     for it:     " + for_it(hypothesis) + "\n     against it: " + against_it(hypothesis, pair);
  if (const Json& places = hypothesis.contradictions(); !places.empty())
    text += format("; the longest, %.1f m, at x %.1f m, y %.1f m of %s's map", places[0].at("length_m").get<double>(),
                   places[0].at("x_m").get<double>(), places[0].at("y_m").get<double>(), pair.a.c_str());
  text += "\n" + sum_of(hypothesis);
  if (hypothesis.is("taken_apart"))
    text += "     merged so at first, and taken apart by the audit of the team's map\n";
  else if (hypothesis.sense == Sense::cameras)
    text += format("     probability by itself %.2f\n", hypothesis.of("probability"));
  else if (hypothesis.sense == Sense::grids || !is_weighed(hypothesis))
    text += format("     overlap %.0f %%, probability by itself %.2f\n", 100.0 * hypothesis.of("overlap"),
                   hypothesis.of("probability"));
  else
    text += format("     overlap %.0f %%\n", 100.0 * hypothesis.of("overlap"));
  return text;
}

// What two hypotheses of one pair are compared by.
double weight_of(const ReportedHypothesis& hypothesis) {
  if (hypothesis.sense == Sense::cameras) return hypothesis.of("matches");
  if (hypothesis.sense == Sense::grids) return hypothesis.of("support_m");
  return fusion::fit_m(hypothesis.of("coinciding_m"), hypothesis.of("unclear_m"), hypothesis.of("contradicted_m"));
}

std::string rivals_in_words(const std::vector<ReportedHypothesis>& hypotheses) {
  std::string text;
  for (std::size_t i = 1; i < hypotheses.size(); ++i) {
    const ReportedHypothesis &best = hypotheses[0], &rival = hypotheses[i];
    if (rival.sense != best.sense || weight_of(best) <= 0.0 || weight_of(rival) <= 0.0) continue;
    const double percent = 100.0 * weight_of(rival) / weight_of(best);
    if (best.sense == Sense::lasers)
      text += format("rival: hypothesis %zu lays %.0f %% as much wall on wall as hypothesis 1\n", i + 1, percent);
    else
      text += format("rival: %.0f %% as much speaks for hypothesis %zu as for hypothesis 1\n", percent, i + 1);
  }
  return text;
}

std::string in_team_in_words(const ReportedPair& pair) {
  if (!pair.is_through_others() || !pair.in_team) return "";
  const bool are_grids = !pair.hypotheses.empty() && pair.hypotheses.front().sense == Sense::grids;
  std::string text = "in the team's map " + where(*pair.in_team, are_grids ? Sense::grids : Sense::lasers, pair);
  const auto audit = pair.verdict.find("audit");
  if (audit != pair.verdict.end() && audit->is_object())
    text +=
        format(": there %.1f m of wall coincide, %.1f m were seen through, %.1f m are unclear",
               audit->value("coinciding_m", 0.0), audit->value("contradicted_m", 0.0), audit->value("unclear_m", 0.0));
  return text + "\n";
}

std::string heading(const ReportedPair& pair) {
  const std::size_t count = pair.hypotheses.size();
  const std::string alone = pair.is_through_others() ? " of these two by themselves" : "";
  if (count > 1) return format("the %zu most probable hypotheses%s:\n", count, alone.c_str());
  if (count == 1) return "the hypothesis" + alone + " there was:\n";
  if (pair.reason == Reason::excluded || pair.reason == Reason::same_recording)
    return "no hypothesis: the two were not compared\n";
  if (pair.is_accepted) return "no hypothesis is reported\n";
  return "no hypothesis" + alone + ": no place of both was found that fits\n";
}

}  // namespace

std::string page(const ReportedPair& pair, const std::vector<std::string>& rasters) {
  std::string text = pair.words + "\n" + in_team_in_words(pair) + heading(pair);
  for (std::size_t i = 0; i < pair.hypotheses.size(); ++i) text += text_of(pair.hypotheses[i], i + 1, pair);
  text += rivals_in_words(pair.hypotheses);
  if (const auto prior = pair.verdict.find("prior"); prior != pair.verdict.end() && prior->is_object())
    text += "prior: " + prior->at("because").get<std::string>() + "\n";
  for (const std::string& raster : rasters) text += "note: " + raster + "\n";
  const std::string_view help = what_helps(pair.reason);
  if (pair.is_through_others())
    text += "nothing has to be done: they lie in one map\n";
  else if (!rasters.empty() && !pair.is_accepted)
    text += "what helps: take a raster of walls and free space, with thresholds that tell them apart\n";
  else if (!help.empty())
    text += "what helps: " + std::string(help) + "\n";
  return text;
}

std::vector<std::string> caption(const ReportedHypothesis& hypothesis, std::size_t number, const ReportedPair& pair) {
  std::string first = hypothesis.is("taken_apart")
                          ? format("%zu. merged so at first, and taken apart by the audit", number)
                          : format("%zu. probability by itself %.2f", number, hypothesis.of("probability"));
  if (!hypothesis.is("taken_apart") && hypothesis.sense != Sense::cameras)
    first += format(", overlap %.0f %%", 100.0 * hypothesis.of("overlap"));
  return {first, "for it: " + for_it(hypothesis), "against it: " + against_it(hypothesis, pair)};
}

}  // namespace mapweave::runtime
