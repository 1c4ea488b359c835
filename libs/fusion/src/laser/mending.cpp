// Where walls of a team stand double, the search for matches goes on: between robots, and between the visits of one.

#include "laser_team.h"

#include "visits.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapweave::fusion {
namespace {

constexpr int kMostMendings = 6;              // of a team
constexpr std::size_t kFewestVisits = 3;      // of which two lie apart
constexpr std::size_t kFewestToOverrule = 3;  // matches of two visits of one robot
// A robot's own loops are overruled where that leaves at most this share of what is in doubt. Each round takes away at
// least so much of what was, or is the last one: outdoors, cars and slopes contradict whatever is mended.
constexpr double kOverruled = 0.5, kWorthwhile = 0.1;

}  // namespace

void LaserMerger::mend_between(LaserTeam& team, const Searcher& search) {
  // Of all rounds the one after which fewest walls are in doubt: what mends one place may break another.
  std::set<Hash> asked;
  LaserTeam best;
  double least_m = std::numeric_limits<double>::infinity();
  const auto anywhere = [](std::size_t, std::size_t) { return true; };
  for (int round = 0; round <= kMostMendings; ++round) {
    const Mending mending = mending_between(team.maps, team.solved, anywhere, PlaceSizes::all, asked);
    if (mending.in_doubt_m < least_m) {
      least_m = mending.in_doubt_m;
      best = team;
    }
    if (mending.matches.empty() || round == kMostMendings) break;
    team.matches.insert(team.matches.end(), mending.matches.begin(), mending.matches.end());
    search(team);
  }
  team = std::move(best);
}

void LaserMerger::mend_within(LaserTeam& team, const Searcher& search) {
  if (std::none_of(team.maps.begin(), team.maps.end(), [&](std::size_t map) { return shows_itself_twice(team, map); }))
    return;
  std::set<Hash> asked;
  LaserTeam bent = team;
  double first_m = 0.0, least_m = std::numeric_limits<double>::infinity();
  for (int round = 0; round <= kMostMendings; ++round) {
    const Mending mending = mending_within(bent, asked);
    if (round == 0) first_m = mending.in_doubt_m;
    if (round > 0 && mending.in_doubt_m > least_m - kWorthwhile * first_m) return;
    least_m = mending.in_doubt_m;
    if (least_m < kOverruled * first_m && !shows_ghosts(bent)) team = bent;
    if (mending.matches.empty() || round == kMostMendings) return;
    bent.matches.insert(bent.matches.end(), mending.matches.begin(), mending.matches.end());
    search(bent);
  }
}

std::vector<SubmapMatch> LaserMerger::overruling(std::size_t map) const {
  std::vector<SubmapMatch> result;
  if (const LaserTeam* team = team_of(map))
    for (const SubmapMatch& match : team->matches)
      if (match.overrules_own && graph_.map_of(match.from) == map) result.push_back(match);
  return result;
}

bool LaserMerger::shows_ghosts(const LaserTeam& team) const {
  return team.maps.size() > 1 && audited(team.maps, pose_in(team.solved), kGhostBeforeSolution).taken_out;
}

LaserMerger::Mending LaserMerger::mending_between(const std::vector<std::size_t>& maps, const SolvedSubmaps& solved,
                                                  const std::function<bool(std::size_t, std::size_t)>& may_match,
                                                  PlaceSizes sizes, std::set<Hash>& asked) {
  const auto may_be_bent = [&](std::size_t i, std::size_t j) {
    const std::size_t a = maps[i], b = maps[j];
    return refused_.count({a, b}) == 0 && !(grids_.is_grid(a) && grids_.is_grid(b)) && may_match(a, b);
  };
  return mending_of(placed_apart(maps, pose_in(solved)), may_be_bent, sizes, asked);
}

// Each submap begins half-way through the one before it: every second one shows all.
std::vector<std::vector<PlacedSubmap>> LaserMerger::visits(const LaserTeam& team, std::size_t map) const {
  if (grids_.is_grid(map) || merged_.team_of(map) != nullptr) return {};
  std::vector<PlacedSubmap> path;
  for (std::size_t s = 0; s < maps_[map].submaps.size(); s += 2)
    path.push_back(placed_submap(map, s, team.solved.pose_of(graph_.number(map, s))));
  return visits_of(path);
}

bool LaserMerger::shows_itself_twice(const LaserTeam& team, std::size_t map) const {
  const auto own = visits(team, map);
  if (own.size() < kFewestVisits) return false;
  std::vector<const std::vector<PlacedSubmap>*> sides;
  std::vector<double> walls_m;
  for (const auto& visit : own) {
    sides.push_back(&visit);
    walls_m.push_back(length_of_walls(visit));
  }
  return audit(own, walls_m, sight_of(sides), are_visits_apart, kGhostBeforeSolution).taken_out.has_value();
}

LaserMerger::Mending LaserMerger::mending_within(const LaserTeam& team, std::set<Hash>& asked) {
  Mending result;
  for (const std::size_t map : team.maps) {
    const auto visits = this->visits(team, map);
    if (visits.size() < kFewestVisits) continue;
    Mending own = mending_of(visits, are_visits_apart, PlaceSizes::all, asked);
    // The map's own loops may hold the walls where they stand double: several matches of two visits overrule them.
    std::map<std::size_t, std::size_t> visit_of;
    for (std::size_t v = 0; v < visits.size(); ++v)
      for (const PlacedSubmap& submap : visits[v]) visit_of[submap.number] = v;
    std::map<std::pair<std::size_t, std::size_t>, std::size_t> matched;
    const auto visits_of_match = [&](const SubmapMatch& match) {
      return std::make_pair(visit_of.at(match.from), visit_of.at(match.to));
    };
    for (const SubmapMatch& match : own.matches) ++matched[visits_of_match(match)];
    for (SubmapMatch& match : own.matches) match.overrules_own = matched[visits_of_match(match)] >= kFewestToOverrule;
    result.matches.insert(result.matches.end(), own.matches.begin(), own.matches.end());
    result.in_doubt_m += own.in_doubt_m;
  }
  return result;
}

LaserMerger::Mending LaserMerger::mending_of(const std::vector<std::vector<PlacedSubmap>>& sides,
                                             const std::function<bool(std::size_t, std::size_t)>& may_be_bent,
                                             PlaceSizes sizes, std::set<Hash>& asked) {
  std::vector<const std::vector<PlacedSubmap>*> all;
  for (const auto& side : sides) all.push_back(&side);
  const SightOf sight = sight_of(all);
  const BentRegions bent = bent_regions(sides, sight, may_be_bent, sizes);
  std::vector<SubmapQuestion> questions;
  for (const BentRegion& region : bent.regions) {
    std::vector<PlacedSubmap> there[2];
    for (const std::size_t side : {0, 1})
      for (const PlacedSubmap& submap : sides[side == 0 ? region.a : region.b])
        if (std::hypot(submap.x_m - region.x_m, submap.y_m - region.y_m) <
            submap.radius_m + 0.5 * RegionAgreement::kSide_m)
          there[side].push_back(submap);
    const auto some =
        proposals_.of_most_shared(there[0], there[1], inverse(region.moved), kBentRadius_m, kBentYaw_rad, sight);
    questions.insert(questions.end(), some.begin(), some.end());
  }
  Mending result{{}, bent.in_doubt_m};
  for (const SubmapAnswer& answer : judge_.ask(questions))
    if (asked.insert(answer.judgement.id).second && answer.holds) result.matches.push_back(answer.hypotheses.front());
  return result;
}

}  // namespace mapweave::fusion
