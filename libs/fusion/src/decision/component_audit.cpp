#include "component_audit.h"
#include "verdict.h"

#include <algorithm>
#include <tuple>

namespace mapweave::fusion {

bool ComponentAudit::pass(const std::vector<Component>& components, const std::vector<PairJoin>& pairs) {
  const LaserMerger& lasers = judging_.lasers();
  const std::vector<PreparedMap>& maps = judging_.maps();
  bool passed = true;
  audits_ = lasers.taken_apart();
  for (const Component& component : components) {
    std::vector<std::size_t> members;
    for (const MapId& id : component.members)
      if (const std::size_t number = judging_.number_of(id); !maps[number].submaps.empty()) members.push_back(number);
    if (members.size() < 2) continue;
    const PoseOfSubmap pose_of = [&](std::size_t map, std::size_t submap) {
      return planar(component.map.nodes.find(maps[map].submaps[submap]->anchor())->map_from_node);
    };
    const TeamAudit audit = lasers.audited(members, pose_of);
    for (const AuditedPair& pair : audit.pairs)
      audits_.push_back(pair_audit(pair, maps[members[pair.a]], maps[members[pair.b]]));
    if (!audit.taken_out || !refuse(members[*audit.taken_out], members, audit, pairs)) continue;
    passed = false;
    for (const PairAudit& ghost : lasers.ghosts_of(audit, members, members[*audit.taken_out], pose_of))
      taken_apart_.push_back(ghost);
  }
  audits_.insert(audits_.end(), taken_apart_.begin(), taken_apart_.end());
  std::stable_sort(audits_.begin(), audits_.end(),
                   [](const PairAudit& l, const PairAudit& r) { return std::tie(l.a, l.b) < std::tie(r.a, r.b); });
  return passed;
}

// From all the others of its team. False where that was said before.
bool ComponentAudit::refuse(std::size_t who, const std::vector<std::size_t>& members, const TeamAudit& audit,
                            const std::vector<PairJoin>& pairs) {
  const auto shows_ghosts = [&](const PairJoin& join) {
    return std::any_of(audit.pairs.begin(), audit.pairs.end(), [&](const AuditedPair& pair) {
      return pair.ghosts_m > 0.0 && members[pair.a] == join.a && members[pair.b] == join.b;
    });
  };
  bool is_new = false;
  for (const PairJoin& pair : pairs) {
    if (pair.a != who && pair.b != who) continue;
    if (!std::binary_search(members.begin(), members.end(), pair.a == who ? pair.b : pair.a)) continue;
    Verdict why = pair.result.verdict;
    if (shows_ghosts(pair)) {
      refuse_by_audit(why);
      if (pair.is_accepted() && !why.hypotheses.empty()) why.hypotheses.front().is_taken_apart = true;
    } else if (pair.is_accepted()) {
      refuse_as_inconsistent(why);
    }
    is_new = judging_.refuse(pair.a, pair.b, why) || is_new;
  }
  return is_new;
}

void check_priors(const LaserMerger& lasers, const std::vector<Component>& components, std::vector<PairJoin>& pairs) {
  constexpr double kProbable = 0.5;  // more likely than not
  for (PairJoin& pair : pairs) {
    Verdict& verdict = pair.result.verdict;
    std::optional<Pose2> a_from_b;
    if (verdict.alignment && verdict.probability > kProbable) a_from_b = planar(verdict.alignment->a_from_b.pose);
    for (const Component& component : components) {
      const Pose3 *a = component.team_from_map.find(verdict.a), *b = component.team_from_map.find(verdict.b);
      if (a != nullptr && b != nullptr) a_from_b = planar(compose(inverse(*a), *b));
    }
    verdict.prior = lasers.check_of_prior(pair.a, pair.b, a_from_b);
  }
}

}  // namespace mapweave::fusion
