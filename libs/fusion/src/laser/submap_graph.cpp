#include "submap_graph.h"

#include "grid/grid_stiffness.h"

#include <mapweave/maps/map_noise.h>

#include <Eigen/LU>
#include <algorithm>
#include <map>

namespace mapweave::fusion {
namespace {

// Where scans of one submap were matched to another, or a loop was closed, in the robot's own map.
constexpr double kRevisit_m = 0.05, kRevisit_rad = 0.006;
constexpr std::size_t kFewestScans = 8;  // matched again in another submap, for a revisit
constexpr std::size_t kNextOnes = 2;     // submaps this near along a trajectory share scans
constexpr std::size_t kBeside = 6;       // submaps along a trajectory for which a match speaks that overrules

std::size_t apart(std::size_t one, std::size_t other) { return one > other ? one - other : other - one; }

Eigen::Matrix3d softened(const Eigen::Matrix3d& information) {
  const Eigen::Matrix3d soft =
      (Eigen::Matrix3d::Identity() + information * submap_bend_covariance()).inverse() * information;
  return 0.5 * (soft + soft.transpose());
}

}  // namespace

std::map<NodeId, std::size_t> homes_of(const PreparedMap& map) {
  std::map<NodeId, std::pair<std::size_t, std::size_t>> best;  // distance from the middle, submap
  for (std::size_t s = 0; s < map.submaps.size(); ++s) {
    const auto& members = map.submaps[s]->submap_from_node;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const std::size_t from_middle = 2 * i > members.size() ? 2 * i - members.size() : members.size() - 2 * i;
      const auto place = best.emplace(members[i].first, std::make_pair(from_middle, s)).first;
      place->second = std::min(place->second, {from_middle, s});
    }
  }
  std::map<NodeId, std::size_t> result;
  for (const auto& [id, home] : best) result.emplace_hint(result.end(), id, home.second);
  return result;
}

Eigen::Vector2d middle_of(const PreparedMap& map, std::size_t submap, const Pose2& team_from_submap) {
  const Pose2 moved = compose(team_from_submap, inverse(map.map_from_submap[submap]));
  const double c = std::cos(moved.phi), s = std::sin(moved.phi);
  const auto& p = map.centres[submap];
  return {moved.x + c * p.x - s * p.y, moved.y + s * p.x + c * p.y};
}

SubmapGraph::SubmapGraph(const std::vector<PreparedMap>& maps, const graph::SolveOptions& options)
    : maps_(maps), options_(options) {
  for (std::size_t m = 0; m < maps.size(); ++m) {
    first_.push_back(map_of_.size());
    map_of_.insert(map_of_.end(), maps[m].submaps.size(), m);
  }
  own_.resize(maps.size());
  for (std::size_t m = 0; m < maps.size(); ++m) add_own_edges(m);
}

void SubmapGraph::add_own_edges(std::size_t map) {
  const PreparedMap& own = maps_[map];
  const auto home_of = homes_of(own);
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> scans;  // matched again, by pair of submaps
  for (const auto& [id, constraint] : own.map->constraints) {
    if (id.kind == ConstraintKind::odometry || (id.kind == ConstraintKind::scan_match && id.index == 0)) continue;
    const auto from = home_of.find(id.from), to = home_of.find(id.to);
    if (from == home_of.end() || to == home_of.end() || from->second == to->second) continue;
    scans[std::minmax(from->second, to->second)] += id.kind == ConstraintKind::loop ? kFewestScans : 1;
  }
  // Of a map that was thinned fewer scans are left to have been matched.
  const auto fewest =
      static_cast<std::size_t>(std::max(1.0, std::round(static_cast<double>(kFewestScans) / own.scans_per_scan)));
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> shared;  // nodes, by pair of submaps
  if (own.is_grid) {
    std::map<NodeId, std::vector<std::size_t>> holders;
    for (std::size_t s = 0; s < own.submaps.size(); ++s)
      for (const auto& member : own.submaps[s]->submap_from_node) holders[member.first].push_back(s);
    for (const auto& entry : holders)
      for (std::size_t i = 0; i < entry.second.size(); ++i)
        for (std::size_t j = i + 1; j < entry.second.size(); ++j) ++shared[{entry.second[i], entry.second[j]}];
  }
  const auto add = [&](std::size_t from, std::size_t to, const Eigen::Matrix3d& information, bool is_loop) {
    own_[map].push_back({first_[map] + from, first_[map] + to,
                         between(own.map_from_submap[from], own.map_from_submap[to]), information, is_loop});
  };
  for (std::size_t s = 0; s + 1 < own.submaps.size(); ++s) {
    const Pose2 step = between(own.map_from_submap[s], own.map_from_submap[s + 1]);
    const double length = std::hypot(step.x, step.y);
    add(s, s + 1, own.is_grid ? grid_stiffness(step.x, step.y) : submap_step_information(length), false);
  }
  for (const auto& [pair, count] : shared) {
    const Pose2 step = between(own.map_from_submap[pair.first], own.map_from_submap[pair.second]);
    if (pair.second - pair.first > 1) add(pair.first, pair.second, grid_stiffness(step.x, step.y), false);
  }
  for (const auto& [pair, count] : scans)
    if (pair.second - pair.first > 1 && count >= fewest)
      add(pair.first, pair.second, planar_information(kRevisit_m, kRevisit_rad), pair.second - pair.first > kNextOnes);
}

bool SubmapGraph::is_constrained(std::size_t one, std::size_t other) const {
  if (map_of_[one] != map_of_[other]) return false;
  const auto [low, high] = std::minmax(one, other);
  if (high - low <= kNextOnes) return true;
  const auto& own = own_[map_of_[one]];
  return std::any_of(own.begin(), own.end(),
                     [low = low, high = high](const OwnEdge& edge) { return edge.from == low && edge.to == high; });
}

bool SubmapGraph::is_overruled(std::size_t one, std::size_t other, const std::vector<SubmapMatch>& matches) {
  const auto [low, high] = std::minmax(one, other);
  return high - low > kNextOnes &&
         std::any_of(matches.begin(), matches.end(), [low = low, high = high](const SubmapMatch& match) {
           const auto [from, to] = std::minmax(match.from, match.to);
           return match.overrules_own && apart(low, from) <= kBeside && apart(high, to) <= kBeside;
         });
}

SolvedSubmaps SubmapGraph::solve(const std::vector<std::size_t>& members,
                                 const std::vector<SubmapMatch>& matches) const {
  SolvedSubmaps solved;
  for (const std::size_t m : members)
    for (std::size_t s = 0; s < maps_[m].submaps.size(); ++s) solved.submaps.push_back(number(m, s));
  // Maps begin where the most probable matches put them.
  std::map<std::size_t, Pose2> team_from_map;
  std::vector<const SubmapMatch*> order;
  for (const SubmapMatch& match : matches)
    if (map_of(match.from) != map_of(match.to)) order.push_back(&match);
  std::stable_sort(order.begin(), order.end(), [](const SubmapMatch* l, const SubmapMatch* r) {
    return std::make_pair(l->is_observable, l->probability) > std::make_pair(r->is_observable, r->probability);
  });
  const auto map_from = [&](std::size_t submap) { return maps_[map_of(submap)].map_from_submap[submap_of(submap)]; };
  for (const std::size_t m : members) {
    if (team_from_map.count(m) != 0) continue;
    team_from_map[m] = {};
    for (bool any = true; any;) {
      any = false;
      for (const SubmapMatch* match : order) {
        const std::size_t a = map_of(match->from), b = map_of(match->to);
        const bool has_a = team_from_map.count(a) != 0, has_b = team_from_map.count(b) != 0;
        if (has_a == has_b) continue;
        const Pose2 a_from_b =
            compose(compose(map_from(match->from), match->from_from_to), inverse(map_from(match->to)));
        if (has_a)
          team_from_map[b] = compose(team_from_map[a], a_from_b);
        else
          team_from_map[a] = compose(team_from_map[b], inverse(a_from_b));
        any = true;
        break;
      }
    }
  }
  std::vector<Pose2> initial;
  for (const std::size_t s : solved.submaps) initial.push_back(compose(team_from_map[map_of(s)], map_from(s)));
  const auto place = [&](std::size_t s) { return static_cast<std::uint32_t>(solved.place_of(s)); };
  std::vector<const OwnEdge*> own;
  for (const std::size_t m : members)
    for (const OwnEdge& edge : own_[m]) {
      if (edge.is_loop && is_overruled(edge.from, edge.to, matches)) {
        solved.doubted.emplace_back(edge.from, edge.to);
        continue;
      }
      solved.edges.push_back(
          {place(edge.from), place(edge.to), edge.from_from_to, edge.information, edge.is_loop && !matches.empty()});
      own.push_back(&edge);
    }
  for (const SubmapMatch& match : matches)
    solved.edges.push_back({place(match.from), place(match.to), match.from_from_to, softened(match.information), true});
  if (matches.empty()) {
    solved.team_from_submap = std::move(initial);
    solved.weights.assign(solved.edges.size(), 1.0);
    return solved;
  }
  graph::Solution solution = graph::solve(initial, solved.edges, options_);
  solved.team_from_submap = std::move(solution.poses);
  solved.weights = std::move(solution.weight);
  for (std::size_t k = 0; k < own.size(); ++k)
    if (solved.weights[k] < 0.5) solved.doubted.emplace_back(own[k]->from, own[k]->to);
  solved.match_weight.assign(solved.weights.begin() + static_cast<std::ptrdiff_t>(own.size()), solved.weights.end());
  for (std::size_t k = own.size(); k < solved.edges.size(); ++k)
    solved.chi2 += solved.weights[k] * graph::chi2_of(solved.edges[k], solved.team_from_submap);
  return solved;
}

}  // namespace mapweave::fusion
