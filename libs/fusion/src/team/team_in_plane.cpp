#include "team_in_plane.h"
#include "decision/verdict.h"
#include "followers.h"
#include "joint_transforms.h"
#include "relative_pose_constraints.h"
#include "visual/visual_team.h"

#include <mapweave/rig/laser_camera_alignment.h>
#include <mapweave/rig/scale.h>

#include <algorithm>

namespace mapweave::fusion {
namespace {

constexpr double kBend_weight = 16.0;  // 1 / (0.25 m)^2: maps bend

// The places that the pair's witnesses put on each other. `join`: with the numbers of the members, whose maps are
// rescaled so.
Join joint_terms(const PairJoin& pair, Join join, double scale_a, double scale_b, const std::vector<PreparedMap>& maps,
                 const std::deque<VisualMap>& seen) {
  const double share = 1.0 / static_cast<double>(pair.witnesses());
  for (const auto& w : pair.result.witnesses) {
    const auto& p = maps[pair.b].centres[w.submap_b];
    const double c = std::cos(w.a_from_b.phi), s = std::sin(w.a_from_b.phi);
    join.terms.push_back({w.a_from_b.x + c * p.x - s * p.y, w.a_from_b.y + s * p.x + c * p.y, p.x, p.y, w.a_from_b.phi,
                          kBend_weight * share});
  }
  const auto node = [](const VisualMap& map, std::size_t keyframe, double scale) {
    const MappedKeyframe& content = map.keyframes()[keyframe];
    return scale == 1.0 ? content.map_from_node
                        : rig::rescaled(content.map_from_node, rig::extrinsics_of(map.map()), scale);
  };
  const VisualMap &of_a = seen[pair.a], &of_b = seen[pair.b];
  for (const VisualWitness& w : pair.seen) {
    const MetricWitness metric = rescaled(w, of_a, of_b, scale_a, scale_b);
    const Eigen::Vector3d p = node(of_b, w.keyframe_b, scale_b).t,
                          q = transformed(metric.node_a_from_node_b.t, node(of_a, w.keyframe_a, scale_a));
    join.terms.push_back({q.x(), q.y(), p.x(), p.y(), planar(w.a_from_b.pose).phi, kBend_weight * share});
  }
  join.strength = 4.0 + 4.0 * static_cast<double>(std::min<std::size_t>(10, pair.witnesses()));
  return join;
}

Constraint constraint_of(const SubmapMatch& match, const SubmapGraph& graph, const std::vector<PreparedMap>& maps) {
  Witness witness;
  witness.judgement.id = match.judgement;
  witness.submap_a = graph.submap_of(match.from);
  witness.submap_b = graph.submap_of(match.to);
  witness.submap_a_from_submap_b = match.from_from_to;
  witness.submap_information = match.information;
  return constraint_of(witness, maps[graph.map_of(match.from)], maps[graph.map_of(match.to)]);
}

// A map's nodes where the team has them: as bent, or moved as a whole.
void add_nodes(const Map& map, const Pose3& team_from_map, const std::vector<Pose2>& bent,
               std::vector<std::pair<NodeId, Node>>& nodes) {
  std::size_t k = 0;
  for (const auto& [id, node] : map.nodes) {
    Node moved = node;
    if (bent.empty())
      moved.map_from_node = compose(team_from_map, node.map_from_node);
    else
      moved.map_from_node =
          compose(compose(spatial(bent[k++]), inverse(spatial(planar(node.map_from_node)))), node.map_from_node);
    nodes.emplace_back(id, std::move(moved));
  }
}

}  // namespace

std::optional<std::vector<Sim3>> TeamInPlane::place(const TeamMembers& members) const {
  if (const LaserTeam* lasers = judging_.lasers().team_of(members.maps.front());
      lasers != nullptr && lasers->maps == members.maps)
    return as_lasers_have_it(*lasers);
  if (members.maps.size() == 1) return std::vector<Sim3>(1);
  std::vector<Sim3> team_from_map = strongest_tree(members).team_from_map;
  rescale_to_metres(members, team_from_map);
  std::vector<Join> terms;
  std::vector<Pose2> start;
  for (const Sim3& pose : team_from_map) start.push_back(planar(pose.pose));
  for (const PairJoin* join : members.joins) {
    const std::size_t a = members.place_of(join->a), b = members.place_of(join->b);
    terms.push_back(joint_terms(*join, {a, b, 0.0, {}}, team_from_map[a].scale, team_from_map[b].scale, maps_, seen_));
  }
  const JointTransforms solution = solve_joint_transforms(members.maps.size(), terms, start);
  bool do_all_agree = true;
  for (std::size_t i = 0; i < members.joins.size(); ++i) {
    if (solution.switches[i] >= 0.5 || members.joins[i]->is_matched_by_lasers) continue;
    refuse_as_inconsistent(members.joins[i]->result.verdict);
    do_all_agree = false;
  }
  if (!do_all_agree) return std::nullopt;
  for (std::size_t i = 0; i < team_from_map.size(); ++i) team_from_map[i].pose = spatial(solution.team_from_map[i]);
  return team_from_map;
}

std::vector<Sim3> TeamInPlane::as_lasers_have_it(const LaserTeam& team) const {
  std::vector<Sim3> team_from_map;
  for (const std::size_t m : team.maps) {
    const Pose2& first = team.solved.pose_of(judging_.lasers().graph().number(m, 0));
    team_from_map.push_back({spatial(compose(first, inverse(maps_[m].map_from_submap.front()))), 1.0});
  }
  return team_from_map;
}

// Where the team's graph of submaps puts each node of a map that lasers matched to others, by the submap that it is in
// or comes after; the first map that was matched so lies where it was placed. Empty for a map that was matched to none.
std::vector<Pose2> TeamInPlane::bent_nodes(std::size_t number, const TeamMembers& members,
                                           const std::vector<Sim3>& placed) const {
  const LaserTeam* lasers = judging_.lasers().team_of(number);
  if (lasers == nullptr || lasers->matches.empty()) return {};
  const SubmapGraph& graph = judging_.lasers().graph();
  const PreparedMap &map = maps_[number], &first = maps_[lasers->maps.front()];
  const Pose2 there = planar(placed[members.place_of(lasers->maps.front())].pose);
  const Pose2& first_submap = lasers->solved.pose_of(graph.number(lasers->maps.front(), 0));
  const Pose2 team_from_lasers = compose(there, compose(first.map_from_submap.front(), inverse(first_submap)));
  std::vector<Pose2> team_from_map;  // by each submap
  for (std::size_t s = 0; s < map.submaps.size(); ++s)
    team_from_map.push_back(compose(
        team_from_lasers, compose(lasers->solved.pose_of(graph.number(number, s)), inverse(map.map_from_submap[s]))));
  std::vector<Pose2> result;
  std::size_t current = 0;
  const auto home_of = map.is_grid ? homes_of(map) : std::map<NodeId, std::size_t>();  // tiles have no order in time
  for (const auto& [id, node] : map.map->nodes) {
    if (map.is_grid) current = home_of.at(id);
    while (!map.is_grid && current + 1 < map.submaps.size() && !(id < map.submaps[current + 1]->anchor())) ++current;
    result.push_back(compose(team_from_map[current], planar(node.map_from_node)));
  }
  return result;
}

// Two grids hold each other tile by tile, so that both can bend.
void TeamInPlane::add_laser_matches(const LaserTeam& lasers, std::vector<Constraint>& constraints) const {
  const SubmapGraph& graph = judging_.lasers().graph();
  const MergedTeams& merged = judging_.lasers().merged();
  for (const MergedTeam& team : merged.teams())
    if (!team.is_reopened && std::includes(lasers.maps.begin(), lasers.maps.end(), team.maps.begin(), team.maps.end()))
      constraints.insert(constraints.end(), team.given->constraints.begin(), team.given->constraints.end());
  std::set<std::pair<std::size_t, std::size_t>> grids;
  for (const SubmapMatch& match : lasers.matches) {
    const std::pair<std::size_t, std::size_t> pair = std::minmax(graph.map_of(match.from), graph.map_of(match.to));
    if (merged.are_together(pair.first, pair.second)) continue;
    if (judging_.grids().pair(pair.first, pair.second) == nullptr)
      constraints.push_back(constraint_of(match, graph, maps_));
    else
      grids.insert(pair);
  }
  for (const auto& [a, b] : grids)
    for (Constraint& constraint : judging_.grids().constraints(a, b)) constraints.push_back(std::move(constraint));
}

std::vector<Constraint> TeamInPlane::constraints_between(const TeamMembers& members,
                                                         const std::vector<Sim3>& team_from_map) const {
  std::vector<Constraint> constraints;
  for (const LaserTeam& lasers : judging_.lasers().teams())
    if (members.contains(lasers.maps.front())) add_laser_matches(lasers, constraints);
  for (const PairJoin* join : members.joins)
    for (const VisualWitness& w : join->seen)
      constraints.push_back(constraint_of(w, seen_[join->a], seen_[join->b],
                                          team_from_map[members.place_of(join->a)].scale,
                                          team_from_map[members.place_of(join->b)].scale));
  return constraints;
}

// What lasers alone merged lies well enough to match scans: their graph of submaps bent it.
bool TeamInPlane::is_bent_by_lasers(const TeamMembers& members) const {
  const LaserTeam* lasers = judging_.lasers().team_of(members.maps.front());
  return lasers != nullptr && lasers->maps == members.maps &&
         std::none_of(members.maps.begin(), members.maps.end(),
                      [&](std::size_t m) { return judging_.maps()[m].is_grid; });
}

// Which of a map's own constraints are left out, because matches of its team overrule them. Empty: none is.
std::function<bool(const ConstraintId&)> TeamInPlane::overruled(std::size_t map) const {
  const LaserMerger& lasers = judging_.lasers();
  const std::vector<SubmapMatch> matches = lasers.overruling(map);
  if (matches.empty()) return {};
  return [homes = homes_of(maps_[map]), first = lasers.graph().first_of(map), matches](const ConstraintId& id) {
    if (id.kind == ConstraintKind::odometry || (id.kind == ConstraintKind::scan_match && id.index == 0)) return false;
    const auto from = homes.find(id.from), to = homes.find(id.to);
    return from != homes.end() && to != homes.end() &&
           SubmapGraph::is_overruled(first + from->second, first + to->second, matches);
  };
}

// A map whose scans were matched again when it was made holds what that found; so do maps that were merged before.
std::function<bool(const NodeId&, const Submap&)> TeamInPlane::matched_by_themselves(const TeamMembers& members) const {
  std::map<SessionId, std::size_t> first_of;  // the first map of those that are merged already
  for (const std::size_t m : members.maps) {
    const Map& map = *judging_.maps()[m].map;
    const MergedTeam* merged = judging_.lasers().merged().team_of(m);
    const bool is_matched =
        merged != nullptr || std::any_of(map.constraints.begin(), map.constraints.end(), [](const auto& entry) {
          return entry.first.kind == ConstraintKind::scan_match && entry.first.index > 0;
        });
    if (!is_matched || (merged == nullptr && overruled(m))) continue;
    for (const auto& entry : map.submaps)
      first_of.emplace(entry.second.id.session, merged != nullptr ? merged->maps.front() : m);
  }
  return [first_of](const NodeId& node, const Submap& submap) {
    const auto of_node = first_of.find(node.session), of_submap = first_of.find(submap.id.session);
    return of_node != first_of.end() && of_submap != first_of.end() && of_node->second == of_submap->second;
  };
}

// Of maps that were thinned: each scan that is left stands for those that were left out beside it.
std::vector<Constraint> TeamInPlane::rematched(const TeamMembers& members, const Map& team) const {
  std::map<SessionId, double> scans;
  for (const std::size_t m : members.maps)
    for (const SessionId& session : maps_[m].map->sessions()) scans.emplace(session, maps_[m].scans_per_scan);
  std::vector<Constraint> constraints =
      matching::rematch(team, options_.rematch, pool_, matched_by_themselves(members), &judging_.models());
  for (Constraint& constraint : constraints)
    if (const double each = scans.at(constraint.id.to.session); each != 1.0) constraint.information *= each;
  return constraints;
}

void TeamInPlane::solve(const TeamMembers& members, const std::vector<Sim3>& team_from_map,
                        Component& component) const {
  // A robot whose own walls stood twice was bent by itself.
  const LaserTeam* lasers = judging_.lasers().team_of(members.maps.front());
  const bool is_alone = members.maps.size() == 1 && (lasers == nullptr || lasers->matches.empty());
  Map& team = component.map;
  std::vector<std::pair<NodeId, Node>> nodes;
  std::vector<Constraint> constraints;
  for (std::size_t i = 0; i < members.maps.size(); ++i) {
    const Map& own = judging_.map_in_team(members.maps[i], is_alone);
    const double scale = team_from_map[i].scale;
    const Map rescaled = scale != 1.0 ? rig::rescaled(own, scale) : Map();
    const Map& map = scale != 1.0 ? rescaled : own;
    add_nodes(map, team_from_map[i].pose,
              is_alone ? std::vector<Pose2>() : bent_nodes(members.maps[i], members, team_from_map), nodes);
    for (const auto& [id, submap] : map.submaps) team.submaps.set(id, submap);
    for (const auto& [id, landmark] : map.landmarks) team.landmarks.set(id, landmark);
    const auto is_overruled = is_alone ? std::function<bool(const ConstraintId&)>() : overruled(members.maps[i]);
    for (const auto& [id, constraint] : map.constraints)
      if (!is_overruled || !is_overruled(id)) constraints.push_back(constraint);
    if (is_alone || !map.submaps.empty()) continue;
    for (Constraint& edge : rig::covisibility_constraints(map, options_.laser_cameras))
      constraints.push_back(std::move(edge));
  }
  std::sort(nodes.begin(), nodes.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  team.nodes.reserve(nodes.size());
  for (auto& [id, node] : nodes) team.nodes.set(id, std::move(node));
  if (!is_alone)
    for (Constraint& constraint : constraints_between(members, team_from_map))
      constraints.push_back(std::move(constraint));
  add_constraints(team, std::move(constraints));
  const Followers followers(team);
  if (!is_alone && !input_.is_preview) {
    if (!is_bent_by_lasers(members)) graph::optimise(team, options_.solve);
    add_constraints(team, rematched(members, team));
    graph::optimise(team, options_.solve);
  }
  followers.put_back(team);
  if (!is_alone) back_to_lowest(*maps_[members.maps.front()].map, team);
}

bool TeamInPlane::adjust_cameras(const TeamMembers& members, const std::vector<Sim3>& team_from_map,
                                 Component& team) const {
  if (input_.is_preview || options_.visual.adjustments == 0) return false;
  std::vector<std::size_t> with_cameras;
  std::vector<const VisualMap*> seen;
  std::vector<Sim3> placed;
  for (std::size_t i = 0; i < members.maps.size(); ++i) {
    const std::size_t m = members.maps[i];
    if (seen_[m].empty()) continue;
    with_cameras.push_back(m);
    seen.push_back(&seen_[m]);
    placed.push_back(team_from_map[i]);
  }
  if (seen.size() < 2) return false;
  const PreparedMap& lowest = maps_[members.maps.front()];
  std::optional<NodeId> stays;  // a camera's first place may be far off, so there the frame follows it instead
  if (!lowest.submaps.empty()) stays = first_within(*lowest.map, team.map).first;
  auto adjusted = adjust_beside_lasers(seen, team.map, stays, placed, claimed_within(with_cameras), options_.visual);
  if (!adjusted) return false;
  for (auto& [id, node] : adjusted->nodes)
    if (id != stays) team.map.nodes.find(id)->map_from_node = node.map_from_node;
  team.map.landmarks = std::move(adjusted->landmarks);
  team.same_as = std::move(adjusted->same_as);
  if (stays) return true;
  const Pose3 shift = back_to_lowest(*lowest.map, team.map);
  for (auto& entry : team.team_from_map) entry.second = compose(shift, entry.second);
  return true;
}

}  // namespace mapweave::fusion
