#include "team_shape.h"

#include <mapweave/graph/spatial_graph.h>
#include <mapweave/maps/map_noise.h>

#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr std::size_t kCovisible = 5;  // covisible keyframes that each is constrained to

}  // namespace

std::vector<graph::RelativePoseConstraint> shape_constraints(const TeamState& team, double stiffness) {
  std::vector<graph::RelativePoseConstraint> result;
  const auto add_constraint = [&](std::size_t from, std::size_t to, double slack) {
    const Pose3 from_from_to = between(team.keyframes[from].team_from_node, team.keyframes[to].team_from_node);
    result.push_back(
        {static_cast<std::uint32_t>(from), static_cast<std::uint32_t>(to), from_from_to,
         stiffness * slack * (kCovisibleMotion.sigma_m + kCovisibleMotion.sigma_per_m * from_from_to.t.norm()),
         stiffness * slack * kCovisibleMotion.sigma_rad});
  };
  for (std::size_t i = 0; i < team.keyframes.size(); ++i) {
    const std::size_t first = team.first_keyframe[team.keyframes[i].member];
    if (i > first && !team.are_of_one_rig(i - 1, i)) add_constraint(i - 1, i, 2.0);
    const auto& covisible = team.keyframes[i].content->covisible;
    for (std::size_t c = 0; c < covisible.size() && c < kCovisible; ++c)
      if (covisible[c].first >= static_cast<std::size_t>(kCovisibleMotion.least_shared))
        add_constraint(covisible[c].second + first, i, 1.0);
  }
  for (std::size_t m = 0; m < team.members.size(); ++m)
    for (const Constraint* rigid : team.rigs[m]) {
      const std::size_t from = team.first_keyframe[m] + team.members[m]->number_of(rigid->id.from),
                        to = team.first_keyframe[m] + team.members[m]->number_of(rigid->id.to);
      result.push_back({static_cast<std::uint32_t>(from), static_cast<std::uint32_t>(to),
                        between(team.keyframes[from].team_from_node, team.keyframes[to].team_from_node),
                        stiffness / std::sqrt(rigid->information(0, 0)),
                        stiffness / std::sqrt(rigid->information(5, 5))});
    }
  return result;
}

void correct_loops(TeamState& team) {
  std::vector<Pose3> poses;
  for (const TeamKeyframe& keyframe : team.keyframes) poses.push_back(keyframe.team_from_node);
  std::vector<graph::SpatialEdge> edges;
  for (const graph::RelativePoseConstraint& constraint : shape_constraints(team, 1.0)) {
    graph::SpatialEdge edge{constraint.from, constraint.to, constraint.from_from_to,
                            Eigen::Matrix<double, 6, 6>::Zero()};
    edge.information.diagonal().head<3>().setConstant(1.0 / (constraint.sigma_m * constraint.sigma_m));
    edge.information.diagonal().tail<3>().setConstant(1.0 / (constraint.sigma_rad * constraint.sigma_rad));
    edges.push_back(edge);
  }
  for (const VisualJoin& join : team.joins)
    for (const VisualWitness& w : *join.witnesses) {
      const MetricWitness metric = team.in_team(join, w);
      edges.push_back({static_cast<std::uint32_t>(team.first_keyframe[join.a] + w.keyframe_a),
                       static_cast<std::uint32_t>(team.first_keyframe[join.b] + w.keyframe_b),
                       metric.node_a_from_node_b, metric.information});
    }
  const graph::SpatialSolution solution = graph::solve(poses, edges);
  for (std::size_t i = 0; i < team.keyframes.size(); ++i) team.keyframes[i].team_from_node = solution.poses[i];
}

}  // namespace mapweave::fusion
