#include "laser_team.h"

#include "decision/commitment.h"
#include "early_end.h"
#include "sorted_numbers.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::fusion {
namespace {

// Of the last search of a team: bounds the time; most end before, after rounds without a new match.
constexpr int kMostRounds = 32;
constexpr std::size_t kMostAtOnce = std::size_t{1} << 20U;  // questions of a pair of maps: more than a pair has

}  // namespace

LaserMerger::LaserMerger(const std::vector<PreparedMap>& maps, const GridAlignments& grids, const FusionInput& input,
                         const FusionOptions& options, const std::set<std::pair<std::size_t, std::size_t>>& refused,
                         const JudgeResources& resources)
    : maps_(maps),
      grids_(grids),
      input_(input),
      options_(options),
      refused_(refused),
      memo_(resources.memo),
      graph_(maps, options.solve),
      priors_(maps, graph_, input.priors),
      merged_(maps, graph_, input.merged, resources.memo),
      judge_(maps, graph_, options, input.vetoed, resources),
      search_(maps, graph_, judge_),
      proposals_(maps, graph_) {
  for (const MapPair& pair : refused)
    if (input.refused.count({maps[pair.first].map->id, maps[pair.second].map->id}) != 0) refused_by_user_.insert(pair);
}

void LaserMerger::remember_teams() {
  place_of_team_.assign(maps_.size(), ~std::size_t{0});
  for (std::size_t place = 0; place < teams_.size(); ++place)
    for (const std::size_t map : teams_[place].maps) place_of_team_[map] = place;
}

PlacedSubmap LaserMerger::placed_submap(std::size_t map, std::size_t submap, const Pose2& pose) const {
  const PreparedMap& of = maps_[map];
  const Eigen::Vector2d middle = middle_of(of, submap, pose);
  const double radius_m = of.radii_m[submap];
  return {graph_.number(map, submap), pose, middle.x(), middle.y(), radius_m, &of.walls[submap]};
}

std::vector<PlacedSubmap> LaserMerger::placed(const std::vector<std::size_t>& maps, const PoseOfSubmap& pose_of) const {
  std::vector<PlacedSubmap> result;
  for (const std::size_t m : maps)
    for (const std::size_t s : maps_[m].representatives) result.push_back(placed_submap(m, s, pose_of(m, s)));
  return result;
}

SightOf LaserMerger::sight_of(const std::vector<const std::vector<PlacedSubmap>*>& sides) const {
  std::vector<std::size_t> numbers;
  for (const auto* side : sides)
    for (const PlacedSubmap& submap : *side) numbers.push_back(submap.number);
  judge_.prepare_sights(numbers);
  return [this](std::size_t number) { return judge_.sight(number); };
}

// Pairs of teams, the lower place first, of which anything is known: between the others there is no hypothesis.
std::vector<std::pair<std::size_t, std::size_t>> LaserMerger::comparable_teams() const {
  std::vector<std::pair<std::size_t, std::size_t>> result;
  const auto add = [&](const MapPair& pair) {
    const auto [x, z] = std::minmax(place_of_team_[pair.first], place_of_team_[pair.second]);
    if (x != z && z < teams_.size()) result.emplace_back(x, z);
  };
  for (const MapPair& pair : answered_) add(pair);
  for (const auto& entry : grids_.pairs()) add(entry.first);
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

// Those first whose places match most.
std::vector<std::pair<std::size_t, std::size_t>> LaserMerger::likeliest_first() const {
  std::vector<std::tuple<double, std::size_t, std::size_t>> order;
  for (const auto& [x, z] : comparable_teams()) {
    double weight = 0.0;
    for (const SubmapAnswer* answer : answers_between(teams_[x], teams_[z]))
      if (answer->holds)
        weight += log_odds(answer->hypotheses.front().probability) * answer->judgement.evidence.overlap_m2;
    order.emplace_back(-weight, x, z);
  }
  std::sort(order.begin(), order.end());
  std::vector<std::pair<std::size_t, std::size_t>> result;
  for (const auto& [weight, x, z] : order) result.emplace_back(x, z);
  return result;
}

// What is certain at once, the likeliest first; else the surest of all.
bool LaserMerger::merge_surest() {
  double surest = options_.merge_probability;
  std::size_t best_x = 0, best_z = 0;
  const Evaluation* best = nullptr;
  for (const auto& [x, z] : likeliest_first()) {
    const Evaluation& evaluation = evaluated(teams_[x], teams_[z]);
    if (evaluation.hypotheses.empty() || evaluation.probability < surest) continue;
    const MergeHypothesis& hypothesis = evaluation.hypotheses.front();
    if (best != nullptr && evaluation.probability == surest &&
        hypothesis.walls.distinctive_m <= best->hypotheses.front().walls.distinctive_m)
      continue;
    surest = evaluation.probability;
    best_x = x;
    best_z = z;
    best = &evaluation;
    if (hypothesis.log_odds >= kCertain && evaluation.rival <= options_.max_rival && !evaluation.repeats) break;
  }
  if (best == nullptr) return false;
  const MergeHypothesis& chosen = best->hypotheses.front();
  LaserTeam& x = teams_[best_x];
  const LaserTeam& z = teams_[best_z];
  merges_.push_back({x.maps, z.maps, best->probability, chosen.is_of_grids ? kGridProposer : to_text(chosen.proposer)});
  x.maps = united(x.maps, z.maps);
  x.matches.insert(x.matches.end(), z.matches.begin(), z.matches.end());
  x.matches.insert(x.matches.end(), chosen.matches.begin(), chosen.matches.end());
  x.solved = chosen.solved;
  teams_.erase(teams_.begin() + static_cast<std::ptrdiff_t>(best_z));
  remember_teams();
  return true;
}

void LaserMerger::close_loops(LaserTeam& team) {
  const auto in_scope = [&](std::size_t i, std::size_t j) {
    const std::size_t a = graph_.map_of(i), b = graph_.map_of(j);
    return refused_.count(std::minmax(a, b)) == 0 && !are_grids(i, j) && !merged_.are_together(a, b);
  };
  const auto search = [&](LaserTeam& of) {
    ConstraintSearchResult found =
        search_.run(of.maps, std::move(of.matches), in_scope, kMostRounds, SearchExtent::final);
    of.matches = std::move(found.matches);
    of.solved = std::move(found.solved);
  };
  if (team.maps.size() > 1) search(team);
  if (input_.is_preview) return;  // where walls stand a little apart, the next round may show more
  if (team.maps.size() > 1) {
    if (close_unexpected_loops(team, in_scope)) search(team);
    mend_between(team, search);
  }
  mend_within(team, search);
}

std::vector<std::vector<PlacedSubmap>> LaserMerger::placed_apart(const std::vector<std::size_t>& maps,
                                                                 const PoseOfSubmap& pose_of) const {
  std::vector<std::vector<PlacedSubmap>> result;
  for (const std::size_t map : maps) result.push_back(placed({map}, pose_of));
  return result;
}

TeamAudit LaserMerger::audited(const std::vector<std::size_t>& maps, const PoseOfSubmap& pose_of,
                               const GhostBounds& bounds) const {
  const auto placed_maps = placed_apart(maps, pose_of);
  std::vector<const std::vector<PlacedSubmap>*> sides;
  std::vector<double> walls_m;
  for (const std::size_t map : maps) walls_m.push_back(maps_[map].walls_m);
  for (const auto& side : placed_maps) sides.push_back(&side);
  // Two grids were compared with each other by what grids of other makers may differ in.
  const auto may_show_ghosts = [&](std::size_t a, std::size_t b) { return grids_.pair(maps[a], maps[b]) == nullptr; };
  return audit(placed_maps, walls_m, sight_of(sides), may_show_ghosts, bounds);
}

// A map that the others contradict, at a loop that was not found or anywhere else, is taken out of its team.
bool LaserMerger::take_back() {
  for (const LaserTeam& team : teams_) {
    if (team.maps.size() < 2) continue;
    const PoseOfSubmap pose_of = pose_in(team.solved);
    const TeamAudit audit = audited(team.maps, pose_of, kGhostBeforeSolution);
    if (!audit.taken_out) continue;
    const std::size_t who = team.maps[*audit.taken_out];
    for (PairAudit& ghost : ghosts_of(audit, team.maps, who, pose_of)) taken_apart_.push_back(std::move(ghost));
    for (const AuditedPair& pair : audit.pairs)
      if (const MapPair maps{team.maps[pair.a], team.maps[pair.b]};
          pair.ghosts_m > 0.0 && (maps.first == who || maps.second == who))
        contradicted_.insert(maps);
    remember_taken_back(team, audit, who);
    for (const std::size_t other : team.maps)
      if (other != who) {
        const MapPair pair = std::minmax(who, other);
        refused_.insert(pair);
        pairs_[pair].answers.clear();
      }
    return true;
  }
  return false;
}

void LaserMerger::merge_all() {
  teams_.clear();
  merges_.clear();
  evaluations_.clear();
  merged_.reopen(refused_, refused_by_user_);
  for (std::size_t m = 0; m < maps_.size(); ++m)
    if (!maps_[m].submaps.empty() && merged_.team_of(m) == nullptr) teams_.push_back({{m}, {}, graph_.alone(m)});
  for (const MergedTeam& team : merged_.teams()) {
    if (team.is_reopened) continue;
    teams_.push_back({team.maps, team.matches, graph_.solve(team.maps, team.matches)});
    merges_.insert(merges_.end(), team.merges.begin(), team.merges.end());
  }
  std::sort(teams_.begin(), teams_.end(), [](const LaserTeam& l, const LaserTeam& r) { return l.maps < r.maps; });
  remember_teams();
  bool any = true;
  for (std::size_t count = kFirstRound; any; count = std::min(4 * count, kMostAtOnce)) {
    any = false;
    std::set<MapPair> asked;
    do {
      while (merge_surest()) is_over(input_);
    } while (ask_more(count, asked) && (any = true));
    any = any || (!input_.is_preview && propose_next());
  }
  for (LaserTeam& team : teams_) close_loops(team);
  split_unconnected();
}

// The last solution may have rejected all matches of a map with the others.
void LaserMerger::split_unconnected() {
  std::vector<LaserTeam> parts;
  for (LaserTeam& team : teams_) {
    std::vector<std::size_t> left = team.maps;
    while (!left.empty()) {
      std::vector<std::size_t> part{left.front()};
      for (bool any = true; any;) {
        any = false;
        for (const SubmapMatch& match : team.matches) {
          const std::size_t a = graph_.map_of(match.from), b = graph_.map_of(match.to);
          if (contains(part, a) == contains(part, b)) continue;
          part = united(part, {std::min(a, b), std::max(a, b)});
          any = true;
        }
      }
      if (part.size() == team.maps.size()) {
        parts.push_back(std::move(team));
        break;
      }
      LaserTeam own{part, {}, {}};
      for (const SubmapMatch& match : team.matches)
        if (contains(part, graph_.map_of(match.from))) own.matches.push_back(match);
      own.solved = graph_.solve(part, own.matches);
      parts.push_back(std::move(own));
      std::vector<std::size_t> others;
      std::set_difference(left.begin(), left.end(), part.begin(), part.end(), std::back_inserter(others));
      left = std::move(others);
    }
  }
  teams_ = std::move(parts);
  remember_teams();
}

std::optional<MergedMaps> LaserMerger::merged_maps(const std::vector<std::size_t>& maps) const {
  const LaserTeam* team = team_of(maps.front());
  if (team == nullptr || team->maps != maps || maps.size() < 2) return std::nullopt;
  const auto names = [&](const std::vector<std::size_t>& numbers) {
    std::vector<MapId> result;
    for (const std::size_t map : numbers) result.push_back(maps_[map].map->id);
    return result;
  };
  const auto submap = [&](std::size_t number) {
    return maps_[graph_.map_of(number)].submaps[graph_.submap_of(number)]->id;
  };
  MergedMaps merged;
  merged.members = names(maps);
  for (const TeamsMerged& merge : merges_)
    if (contains(maps, merge.one.front()))
      merged.merges.push_back({names(merge.one), names(merge.other), merge.probability, merge.proposer});
  std::set<Hash> judgements;
  for (const SubmapMatch& match : team->matches) {
    merged.matches.push_back({submap(match.from), submap(match.to), match.from_from_to, match.information,
                              match.probability, match.is_observable, match.judgement, match.overrules_own});
    judgements.insert(match.judgement);
  }
  for (const Hash& id : judgements) merged.judgements.push_back(memo_.at(id));
  return merged;
}

void LaserMerger::run(Progress& progress) {
  open_pairs();
  if (pairs_.empty()) {
    merge_all();
    return;
  }
  const int task = progress.begin("comparing maps", pairs_.size(), "pairs of maps");
  do merge_all();
  while (take_back());
  progress.advance(task, pairs_.size());
  progress.end(task);
}

}  // namespace mapweave::fusion
