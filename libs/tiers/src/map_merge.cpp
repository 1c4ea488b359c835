#include "map_merge.h"

#include <algorithm>
#include <iterator>

namespace mapweave::tiers {
namespace {

constexpr int kLeastPairs = 12;       // of keyframes, compared for a pair of maps
constexpr int kCovisible = 1;         // of a keyframe that is compared
constexpr double kAdjustAgain = 2.0;  // times as many keyframes: then all are adjusted again, not only what is new
constexpr std::size_t kSettled = 5;   // later keyframes of its camera: one's covisible keyframes hardly change any more

}  // namespace

std::vector<Map> MapMerge::copies(const Snapshots& snapshots) {
  std::vector<Map> result;
  for (const auto& [name, map] : snapshots) {
    result.push_back(*map);
    result.back().id = name;
  }
  return result;
}

void MapMerge::refuse(const std::set<std::pair<RobotId, RobotId>>& robots, fusion::FusionInput& input) {
  if (robots.empty()) return;
  for (auto a = input.maps.begin(); a != input.maps.end(); ++a)
    for (auto b = std::next(a); b != input.maps.end(); ++b)
      for (const RobotId& one : a->robots())
        for (const RobotId& other : b->robots())
          if (robots.count(std::minmax(one, other)) != 0) input.refused.insert(std::minmax(a->id, b->id));
}

void MapMerge::run(const MapMerge* last, Snapshots maps, const ServerOptions& options,
                   fusion::FusionOptions fusion_options, WorkerPool& pool) {
  const std::vector<Map> own = copies(maps);
  maps.clear();  // while somebody holds them, updates copy them
  rig::RobotRigs rigs = rig::merge_rigs(own, rig, pool);
  input.maps = std::move(rigs.maps);
  refuse(refused, input);
  notes = std::move(rigs.notes);
  for (const Map& map : input.maps) keyframes += map.nodes.size();
  adjusted_keyframes = last != nullptr ? last->adjusted_keyframes : 0;
  if (static_cast<double>(keyframes) >= kAdjustAgain * static_cast<double>(adjusted_keyframes)) {
    for (fusion::PreviousMerge& team : input.teams) team.is_adjusted_again = true;
    adjusted_keyframes = keyframes;
  }
  fusion::VisualFusionOptions& visual = fusion_options.visual;
  visual.covisible = std::min(visual.covisible, kCovisible);
  const int others = std::max(1, static_cast<int>(input.maps.size()) - 1);
  visual.most_pairs = std::min(visual.most_pairs, std::max(kLeastPairs, options.judged_pairs / others));
  fusion::Memo known = last != nullptr ? last->memo : fusion::Memo();
  auto result = fusion::fuse(input, fusion_options, known, pool, *make_silent_progress());
  leave_to_the_next(result);
  fusion::split_rigs(result, rigs.rigs, own);
  view = std::make_shared<const TeamView>(
      std::move(result), own,
      TeamView::Making{options.index, options.description, input.pictures, std::move(forgotten)}, pool);
  input.pictures->forget();
  input = {};
}

void MapMerge::leave_to_the_next(const fusion::FusionResult& result) {
  std::set<SubmapId> settled;
  for (const Map& map : input.maps)
    for (std::size_t i = 0; i + kSettled < map.nodes.size(); ++i) {
      const auto node = map.nodes.begin() + static_cast<std::ptrdiff_t>(i);
      const NodeId& id = node->first;
      if (node[kSettled].first.session == id.session) settled.insert({id.session, id.index});
    }
  for (const Judgement& judgement : result.judgements) {
    memo.emplace(judgement.id, judgement);
    const bool is_same_place = !judgement.hypotheses.empty() && judgement.doubt == Reason::none;
    if (is_same_place || judgement.a.session == judgement.b.session ||
        (settled.count(judgement.a) != 0 && settled.count(judgement.b) != 0))
      kept_judgements.push_back(judgement);
  }
  for (const fusion::Component& component : result.components) {
    fusion::PreviousMerge& team = teams.emplace_back();
    team.members = component.members;
    for (const auto& [id, node] : component.map.nodes) team.team_from_node.set(id, node.map_from_node);
    for (const Map& map : input.maps)
      if (std::binary_search(team.members.begin(), team.members.end(), map.id))
        for (const auto& [id, node] : map.nodes) team.map_from_node.set(id, node.map_from_node);
  }
}

}  // namespace mapweave::tiers
