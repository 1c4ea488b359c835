#pragma once
// Teams that a tier below has merged, as the merger begins with them.

#include "submap_graph.h"

#include <mapweave/fusion/fuse.h>

#include <set>

namespace mapweave::fusion {

// Two groups of maps that became one; numbers, rising.
struct TeamsMerged {
  std::vector<std::size_t> one, other;
  double probability;
  std::string proposer;  // as in a verdict
};

struct MergedTeam {
  std::vector<std::size_t> maps;  // numbers, rising
  std::vector<SubmapMatch> matches;
  std::vector<TeamsMerged> merges;
  const MergedMaps* given = nullptr;
  bool is_reopened = false;  // two of its maps must not be matched to each other: it is merged anew
};

class MergedTeams {
 public:
  // All outlive it. Judgements that matches rest on go to the memo.
  MergedTeams(const std::vector<PreparedMap>& maps, const SubmapGraph& graph, const std::vector<MergedMaps>& given,
              Memo& memo);

  // `refused`: pairs of maps that must not be matched to each other, the lower first. `by_user`: those of them that
  // somebody said before anything was compared; teams without a match of the two have heeded it.
  using MapPairs = std::set<std::pair<std::size_t, std::size_t>>;
  void reopen(const MapPairs& refused, const MapPairs& by_user);
  const std::vector<MergedTeam>& teams() const { return teams_; }
  const MergedTeam* team_of(std::size_t map) const;  // null where it is in none, or in one that is merged anew
  bool are_together(std::size_t a, std::size_t b) const { return team_of(a) != nullptr && team_of(a) == team_of(b); }

 private:
  bool are_matched(const MergedTeam& team, std::size_t a, std::size_t b) const;

  const SubmapGraph& graph_;
  std::vector<MergedTeam> teams_;
  std::vector<std::size_t> place_of_team_;  // in teams_, of each map; one that is none without a team
};

}  // namespace mapweave::fusion
