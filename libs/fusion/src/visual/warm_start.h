#pragma once
// Where the keyframes of a team begin that was merged before (FusionInput::teams), and which of them the bundle moves:
// the new ones, those that their client moved, and what those see the most of.

#include "visual_team.h"

#include <optional>

namespace mapweave::fusion {

// The largest one of which every member is among these, all of which are metric; null: none.
const PreviousMerge* largest_within(const std::vector<PreviousMerge>& teams,
                                    const std::vector<const VisualMap*>& members);

struct WarmStart {
  std::vector<Pose3> team_from_node;   // of all members' keyframes in a row
  std::vector<char> is_free;           // of each
  std::vector<std::size_t> newcomers;  // members that were not in the team, and lie where what joins them says
};

// nullopt where the team has to be adjusted as a whole: most of it moves, or its maps or what joins them say that it
// lies elsewhere.
std::optional<WarmStart> warm_start(const PreviousMerge& before, const std::vector<const VisualMap*>& members,
                                    const std::vector<VisualJoin>& joins);

}  // namespace mapweave::fusion
