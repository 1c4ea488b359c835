// Loops between robots that are not where the graph expects them: its covariance was too small. Places that look alike
// propose them, several have to agree, and whole walls decide.

#include "laser_team.h"

#include <mapweave/fusion/wall_weights.h>

namespace mapweave::fusion {
namespace {

constexpr int kMostRounds = 12;

}  // namespace

// How well the walls of all pairs of a team's maps lie on each other. The graph bends a loop of hundreds of metres
// evenly, so that some of its walls stand double although it is right: a metre that is contradicted counts once against
// it, not kContradictionWeight times.
LaserMerger::LoopEvidence LaserMerger::loop_evidence(const LaserTeam& team) const {
  LoopEvidence sum;
  for (std::size_t k = 0; k < team.maps.size(); ++k)
    for (std::size_t l = k + 1; l < team.maps.size(); ++l) {
      if (grids_.is_grid(team.maps[k]) || grids_.is_grid(team.maps[l])) continue;
      const WallAgreement walls = agreement(team.solved, {team.maps[k]}, {team.maps[l]});
      sum.fit_m += fit_of(walls);
      sum.log_odds += weighed(walls).sum_m + (kContradictionWeight - 1.0) * walls.contradicted_m;
    }
  return sum;
}

// True: some were closed.
bool LaserMerger::close_unexpected_loops(LaserTeam& team, const SubmapsInScope& in_scope) {
  const SubmapsInScope between_robots = [&](std::size_t i, std::size_t j) {
    return graph_.map_of(i) != graph_.map_of(j) && !are_grids(i, j) && in_scope(i, j);
  };
  ConstraintSearchResult found = search_.run(team.maps, team.matches, between_robots, kMostRounds, SearchExtent::alike);
  if (found.matches.size() <= team.matches.size()) return false;
  LaserTeam closed{team.maps, std::move(found.matches), std::move(found.solved)};
  const LoopEvidence before = loop_evidence(team), after = loop_evidence(closed);
  if (after.fit_m < before.fit_m + kCertain || after.log_odds < before.log_odds + kCertain) return false;
  team = std::move(closed);
  return true;
}

}  // namespace mapweave::fusion
