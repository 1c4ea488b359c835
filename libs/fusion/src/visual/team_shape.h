#pragma once
// The shapes that members of a team bring along, and the graph of all (the essential graph of CORB-SLAM 2.2).

#include "team_state.h"

namespace mapweave::fusion {

// How keyframes lay in their own maps: of those that see the same, of one and the next, and of cameras of one robot at
// the same time. Stiffness: a factor on the standard deviations.
std::vector<graph::RelativePoseConstraint> shape_constraints(const TeamState& team, double stiffness);

// Moves the keyframes to where their shapes and the witnesses of the joins have them together.
void correct_loops(TeamState& team);

}  // namespace mapweave::fusion
