#pragma once
// Stage 4 of fuse() for maps of keyframes: one graph of all of them (the essential graph of CORB-SLAM 2.2), landmarks
// that two maps share found and made one, then the bundle of all adjusted.

#include "claimed_sightings.h"

#include <optional>

namespace mapweave::fusion {

struct VisualJoin {
  std::size_t a = 0, b = 0;  // numbers of the members
  const std::vector<VisualWitness>* witnesses = nullptr;
};

struct VisualTeam {
  Table<NodeId, Node> nodes;
  Table<ConstraintId, Constraint> constraints;  // what the joins rest on, and extrinsics between cameras of one robot
  Table<LandmarkId, Landmark> landmarks;        // of those that are the same the lowest one, with all sightings
  Table<LandmarkId, LandmarkId> same_as;        // which one stands for each that is not there
};

// team_from_map: where the members lie, about; the first keeps its frame. Members have keyframes. claimed: by numbers
// of the members. before: of a merge before, all of whose members are here: it stays for the most part, or all is
// adjusted again, a large team part by part. null: cold.
VisualTeam solve_team(const std::vector<const VisualMap*>& members, const std::vector<VisualJoin>& joins,
                      const std::vector<Sim3>& team_from_map, const std::vector<ClaimedSighting>& claimed,
                      const VisualFusionOptions& options, const PreviousMerge* before = nullptr);

// Of a team with lasers, whose graph is solved: landmarks that members share made one, then keyframes and landmarks
// adjusted, where the robots' lasers hold the keyframes (ConstraintKind::extrinsic) near where that graph has them.
// members: those with keyframes. solved: the team's map, which has all of them. stays: the place that gives the
// frame; a keyframe of that name does not move. No constraints in the result. nullopt: they share nothing.
std::optional<VisualTeam> adjust_beside_lasers(const std::vector<const VisualMap*>& members, const Map& solved,
                                               const std::optional<NodeId>& stays,
                                               const std::vector<Sim3>& team_from_map,
                                               const std::vector<ClaimedSighting>& claimed,
                                               const VisualFusionOptions& options);

}  // namespace mapweave::fusion
