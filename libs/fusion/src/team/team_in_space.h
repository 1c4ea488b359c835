#pragma once
// Teams of cameras alone, which do not stay in a plane: one graph of their keyframes, then the bundle of all
// (visual_team.h).

#include "team_solver.h"

namespace mapweave::fusion {

class TeamInSpace final : public TeamSolver {
 public:
  using TeamSolver::TeamSolver;
  std::optional<std::vector<Sim3>> place(const TeamMembers& members) const override;
  void solve(const TeamMembers& members, const std::vector<Sim3>& team_from_map, Component& team) const override;
};

}  // namespace mapweave::fusion
