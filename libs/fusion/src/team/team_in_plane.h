#pragma once
// Teams with a laser among them, and maps that are alone: one pose graph in the plane. Lasers' maps begin where the
// graph of submaps has bent them (laser/laser_team.h); cameras' maps are rescaled and move as their keyframes do. Then
// what cameras see is adjusted, within what lasers say of where they were.

#include "team_solver.h"

namespace mapweave::fusion {

class TeamInPlane final : public TeamSolver {
 public:
  TeamInPlane(const PairJudging& judging, const FusionInput& input, const FusionOptions& options, WorkerPool& pool)
      : TeamSolver(judging, input, options), pool_(pool) {}
  std::optional<std::vector<Sim3>> place(const TeamMembers& members) const override;
  void solve(const TeamMembers& members, const std::vector<Sim3>& team_from_map, Component& team) const override;
  bool adjust_cameras(const TeamMembers& members, const std::vector<Sim3>& team_from_map,
                      Component& team) const override;

 private:
  std::vector<Sim3> as_lasers_have_it(const LaserTeam& team) const;
  std::vector<Pose2> bent_nodes(std::size_t map, const TeamMembers& members,
                                const std::vector<Sim3>& team_from_map) const;
  bool is_bent_by_lasers(const TeamMembers& members) const;
  std::function<bool(const ConstraintId&)> overruled(std::size_t map) const;
  std::function<bool(const NodeId&, const Submap&)> matched_by_themselves(const TeamMembers& members) const;
  std::vector<Constraint> rematched(const TeamMembers& members, const Map& team) const;
  void add_laser_matches(const LaserTeam& lasers, std::vector<Constraint>& constraints) const;
  std::vector<Constraint> constraints_between(const TeamMembers& members, const std::vector<Sim3>& team_from_map) const;

  WorkerPool& pool_;
};

}  // namespace mapweave::fusion
