#include "warm_start.h"

#include <mapweave/core/median.h>

#include <algorithm>

namespace mapweave::fusion {
namespace {

// A keyframe that its client moved farther than this since the last merge is adjusted again.
constexpr double kMoved_m = 0.02;
// If a client moved a keyframe farther than this, the team is adjusted as a whole.
constexpr double kLaidAgain_m = 0.15;
// The same if the matches of keyframes that moved are off by more than this in the median.
constexpr double kElsewhere_m = 0.1;
constexpr std::size_t kAlong = 3;  // covisible keyframes that move with one

}  // namespace

const PreviousMerge* largest_within(const std::vector<PreviousMerge>& teams,
                                    const std::vector<const VisualMap*>& members) {
  if (std::any_of(members.begin(), members.end(), [](const VisualMap* map) { return !map->is_metric(); }))
    return nullptr;
  const PreviousMerge* largest = nullptr;
  for (const PreviousMerge& team : teams) {
    const auto is_here = [&](const MapId& id) {
      return std::any_of(members.begin(), members.end(), [&](const VisualMap* map) { return map->map().id == id; });
    };
    if (std::all_of(team.members.begin(), team.members.end(), is_here) &&
        (largest == nullptr || team.map_from_node.size() > largest->map_from_node.size()))
      largest = &team;
  }
  return largest;
}

namespace {

// Of maps that were not in the team: as the one witness says that most of the others agree with; the nearest to the
// team first.
class Newcomers {
 public:
  Newcomers(const std::vector<const VisualMap*>& members, const std::vector<VisualJoin>& joins,
            const std::vector<std::size_t>& first, WarmStart& start)
      : members_(members), joins_(joins), first_(first), start_(start) {}

  bool lay(std::vector<std::size_t> members, std::vector<char> placed) {
    while (!members.empty()) {
      const auto next =
          std::find_if(members.begin(), members.end(), [&](std::size_t member) { return lay(member, placed); });
      if (next == members.end()) return false;
      placed[*next] = true;
      members.erase(next);
    }
    return true;
  }

 private:
  bool lay(std::size_t member, const std::vector<char>& placed) {
    const auto& keyframes = members_[member]->keyframes();
    std::vector<Pose3> team_from_map;
    for (const VisualJoin& join : joins_) {
      const std::size_t other = join.a == member ? join.b : join.a;
      if ((join.a != member && join.b != member) || !placed[other]) continue;
      for (const VisualWitness& w : *join.witnesses) {
        const bool is_b = join.b == member;
        const Pose3& here_from_there = w.node_a_from_node_b.pose;
        const Pose3& known = start_.team_from_node[first_[other] + (is_b ? w.keyframe_a : w.keyframe_b)];
        const Pose3 node = compose(known, is_b ? here_from_there : inverse(here_from_there));
        team_from_map.push_back(compose(node, inverse(keyframes[is_b ? w.keyframe_b : w.keyframe_a].map_from_node)));
      }
    }
    if (team_from_map.empty()) return false;
    const Eigen::Vector3d middle = keyframes[keyframes.size() / 2].map_from_node.t;
    std::pair<double, std::size_t> best{1e300, 0};
    for (std::size_t i = 0; i < team_from_map.size(); ++i) {
      double apart = 0.0;
      for (const Pose3& other : team_from_map)
        apart += (transformed(middle, team_from_map[i]) - transformed(middle, other)).norm();
      best = std::min(best, {apart, i});
    }
    for (std::size_t i = 0; i < keyframes.size(); ++i)
      start_.team_from_node[first_[member] + i] = compose(team_from_map[best.second], keyframes[i].map_from_node);
    return true;
  }

  const std::vector<const VisualMap*>& members_;
  const std::vector<VisualJoin>& joins_;
  const std::vector<std::size_t>& first_;
  WarmStart& start_;
};

}  // namespace

std::optional<WarmStart> warm_start(const PreviousMerge& before, const std::vector<const VisualMap*>& members,
                                    const std::vector<VisualJoin>& joins) {
  WarmStart start;
  std::vector<std::size_t> first;  // of each member
  std::vector<char> placed;
  for (const VisualMap* member : members) {
    first.push_back(start.is_free.size());
    const auto& keyframes = member->keyframes();
    placed.push_back(std::binary_search(before.members.begin(), before.members.end(), member->map().id));
    if (!placed.back()) {
      start.newcomers.push_back(first.size() - 1);
      start.team_from_node.resize(start.team_from_node.size() + keyframes.size());
      start.is_free.resize(start.team_from_node.size(), true);
      continue;
    }
    std::vector<const Pose3*> known;
    for (const MappedKeyframe& keyframe : keyframes) known.push_back(before.team_from_node.find(keyframe.id));
    auto on = std::find_if(known.begin(), known.end(), [](const Pose3* pose) { return pose != nullptr; });
    if (on == known.end()) return std::nullopt;
    auto hung = static_cast<std::size_t>(on - known.begin());  // new ones hang on the last one that was there
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      const Pose3* then = before.map_from_node.find(keyframes[i].id);
      if (known[i] != nullptr && then != nullptr) {
        const double moved_m = (keyframes[i].map_from_node.t - then->t).norm();
        if (moved_m > kLaidAgain_m) return std::nullopt;
        hung = i;
        start.team_from_node.push_back(*known[i]);
        start.is_free.push_back(moved_m > kMoved_m);
      } else {
        start.team_from_node.push_back(
            compose(*known[hung], between(keyframes[hung].map_from_node, keyframes[i].map_from_node)));
        start.is_free.push_back(true);
      }
    }
  }
  if (!Newcomers(members, joins, first, start).lay(start.newcomers, placed)) return std::nullopt;
  const std::vector<char> moved = start.is_free;
  for (std::size_t m = 0; m < members.size(); ++m)
    for (std::size_t i = 0; i < members[m]->keyframes().size(); ++i) {
      const auto& covisible = members[m]->keyframes()[i].covisible;
      for (std::size_t c = 0; moved[first[m] + i] && c < std::min(kAlong, covisible.size()); ++c)
        start.is_free[first[m] + covisible[c].second] = true;
    }
  if (2 * static_cast<std::size_t>(std::count(start.is_free.begin(), start.is_free.end(), true)) > start.is_free.size())
    return std::nullopt;
  std::vector<double> apart_m;
  for (const VisualJoin& join : joins)
    for (const VisualWitness& w : *join.witnesses) {
      const std::size_t a = first[join.a] + w.keyframe_a, b = first[join.b] + w.keyframe_b;
      if (moved[a] || moved[b])
        apart_m.push_back(
            (compose(start.team_from_node[a], w.node_a_from_node_b.pose).t - start.team_from_node[b].t).norm());
    }
  if (!apart_m.empty() && median(std::move(apart_m)) > kElsewhere_m) return std::nullopt;
  return start;
}

}  // namespace mapweave::fusion
