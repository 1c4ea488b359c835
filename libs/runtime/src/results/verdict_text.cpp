// A verdict in words.

#include <mapweave/core/format.h>
#include <mapweave/maps/reasons.h>
#include <mapweave/runtime/report.h>

#include <algorithm>
#include <cmath>

namespace mapweave::runtime {
namespace {

std::string names_in_words(const std::vector<MapId>& ids) {
  std::string text;
  for (const MapId& id : ids) text += (text.empty() ? "" : " + ") + id.str();
  return text;
}

std::string numbers_in_words(double probability, const Verdict& verdict) {
  return format("%.2f, overlap %.0f %%, conflict %.1f %%", probability, 100.0 * verdict.overlap,
                100.0 * verdict.conflict);
}

bool is_of_grids(const Verdict& verdict) {
  return !verdict.hypotheses.empty() && verdict.hypotheses.front().sense == Sense::grids;
}

bool is_of_more_than_two(const TeamMerge& merge) { return merge.of.size() + merge.with.size() > 2; }

std::string merge_in_words(const TeamMerge& merge) {
  return format("the merge of %s with %s has probability %.2f", names_in_words(merge.of).c_str(),
                names_in_words(merge.with).c_str(), merge.probability);
}

// How sure a merge is: what was decided is that of two teams, of which the two maps may be a small part.
std::string sureness_in_words(const Verdict& verdict) {
  constexpr double kSame = 0.005;
  const bool is_by_walls = verdict.kind == "laser" || verdict.kind == "grid";
  std::string text;
  if (!is_by_walls || !verdict.merge)
    text = "probability " + numbers_in_words(verdict.probability, verdict);
  else if (is_of_more_than_two(*verdict.merge))
    text = merge_in_words(*verdict.merge) + "; these two maps by themselves: probability " +
           numbers_in_words(verdict.probability, verdict);
  else {
    text = "probability " + numbers_in_words(verdict.merge->probability, verdict);
    if (std::abs(verdict.merge->probability - verdict.probability) > kSame)
      text += format("; as the team has them, by themselves: %.2f", verdict.probability);
  }
  const std::size_t places = verdict.witnesses.size();
  if (!is_of_grids(verdict))
    text += format(", %zu place%s agree%s", places, places == 1 ? "" : "s", places == 1 ? "s" : "");
  return text;
}

// Why two maps were not matched to each other.
std::string doubt_in_words(const Verdict& verdict) {
  std::string text(in_words(verdict.reason));
  if (verdict.reason == Reason::excluded) return text;
  if (verdict.reason == Reason::same_recording)
    return text + format(" (%.0f %% of the scans of one are in the other)", 100.0 * verdict.overlap);
  // Without any alignment there is nothing to count.
  if (verdict.reason == Reason::little_overlap && verdict.probability == 0.0)
    return text + ": no place that both show was found" + (verdict.detail.empty() ? "" : "; " + verdict.detail);
  text += " (probability " + numbers_in_words(verdict.probability, verdict) + ")";
  if (!verdict.detail.empty()) text += "; " + verdict.detail;
  return text;
}

}  // namespace

std::string in_words(const Verdict& verdict) {
  const std::string pair = verdict.a.str() + " + " + verdict.b.str() + ": ";
  const bool is_through_others = verdict.in_one_map && !verdict.in_one_map->through.empty();
  const std::string through = is_through_others ? "through " + names_in_words(verdict.in_one_map->through) : "";
  if (verdict.decision == Decision::accepted) {
    const std::string how = is_through_others ? "merged directly, and " + through : "merged";
    return pair + how + " (" + sureness_in_words(verdict) + ")" +
           (verdict.reason == Reason::none ? "" : "; " + std::string(in_words(verdict.reason)));
  }
  if (verdict.in_one_map) {
    const std::string how = verdict.merge ? " (" + merge_in_words(*verdict.merge) + ")" : "";
    return pair + "in one map" + (through.empty() ? "" : ", " + through) + how +
           "; not matched to each other by themselves: " + doubt_in_words(verdict);
  }
  return pair + (verdict.decision == Decision::deferred ? "not decided: " : "kept apart: ") + doubt_in_words(verdict);
}

std::string in_words(const PriorCheck& prior) {
  const double degrees = prior.off_rad.value_or(0.0) * 180.0 / M_PI;
  if (prior.off_m && prior.is_contradicted)
    return format("the prior is contradicted: the maps lie %.1f m and %.0f degrees from where it puts them",
                  *prior.off_m, degrees);
  if (prior.off_m) return format("the maps agree with the prior within %.2f m and %.1f degrees", *prior.off_m, degrees);
  if (prior.is_contradicted)
    return format(
        "the prior is contradicted: where it puts the maps, %.1f m of walls were seen through, and %.1f m coincide",
        prior.contradicted_m, prior.coinciding_m);
  return "the prior is not confirmed: no place was found that fits as it says";
}

}  // namespace mapweave::runtime
