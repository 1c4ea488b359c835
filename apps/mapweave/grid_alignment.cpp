#include "grid_alignment.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/core/progress.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/maps/reasons.h>

#include <optional>
#include <sstream>

namespace mapweave::app {
namespace {

bool is_same(const OccupancyGrid& a, const OccupancyGrid& b) {
  return a.columns == b.columns && a.rows == b.rows && a.log_odds == b.log_odds;
}

// Of grids that somebody wants to compare: maps of one building, however merge judges that.
std::optional<GridAlignment> best_hypothesis(const Verdict* verdict) {
  constexpr double kLeastOverlap = 0.3;
  if (verdict == nullptr || verdict->hypotheses.empty()) return std::nullopt;
  const PairHypothesis& best = verdict->hypotheses.front();
  if (!(best.overlap > kLeastOverlap) || best.contradicted_m > best.coinciding_m) return std::nullopt;
  return GridAlignment{planar(best.a_from_b.pose), best.a_from_b.scale};
}

GridAlignment as_merged(const OccupancyGrid& a, const OccupancyGrid& b) {
  const MapId first("a"), second("b");
  fusion::FusionInput input;
  input.maps = {fusion::map_of_grid(first, a), fusion::map_of_grid(second, b)};
  fusion::Memo memo;
  WorkerPool pool(1);
  const fusion::FusionResult merged = fusion::fuse(input, {}, memo, pool, *make_silent_progress());
  const fusion::Component& together = merged.components.front();
  if (together.members.size() < 2) {
    const Verdict* verdict = merged.verdicts.empty() ? nullptr : &merged.verdicts.front();
    const std::string reason =
        verdict == nullptr ? std::string("nothing in them is alike") : std::string(in_words(verdict->reason));
    if (is_same(a, b)) return {};
    if (const auto best = best_hypothesis(verdict)) {
      log(LogLevel::warning, "merge would leave the grids apart (" + reason + "); they are compared as they fit best");
      return *best;
    }
    throw Error(ErrorCode::kBadInput, "the grids cannot be aligned: merge would leave them apart (" + reason + ")",
                "--align auto", "say how B lies in A's frame: --align X,Y,YAW");
  }
  const auto scale_of = [&](const MapId& id) {
    const double* scale = together.scales.find(id);
    return scale != nullptr ? *scale : 1.0;
  };
  const Pose2 team_from_a = planar(*together.team_from_map.find(first)),
              team_from_b = planar(*together.team_from_map.find(second));
  const double scale_a = scale_of(first);
  Pose2 a_from_b = between(team_from_a, team_from_b);
  a_from_b.x /= scale_a;
  a_from_b.y /= scale_a;
  return {a_from_b, scale_of(second) / scale_a};
}

}  // namespace

GridAlignment grid_alignment(const std::string& text, const OccupancyGrid& a, const OccupancyGrid& b) {
  if (text == "none") return {};
  if (text == "auto") return as_merged(a, b);
  std::istringstream stream(text);
  double x = 0.0, y = 0.0, yaw = 0.0;
  char comma = 0, second_comma = 0;
  if ((stream >> x >> comma >> y >> second_comma >> yaw) && comma == ',' && second_comma == ',' && stream.peek() == EOF)
    return {Pose2(x, y, yaw), 1.0};
  throw Error(ErrorCode::kUsage, "'" + text + "' is no alignment of grids", "--align",
              "write none, auto, or X,Y,YAW: B's frame in A's, in metres and radians");
}

}  // namespace mapweave::app
