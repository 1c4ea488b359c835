#pragma once
// Stage 4 of fuse(): where the maps of one team lie, and where all their nodes do. Teams with a laser among them are
// solved in the plane, teams of cameras alone in space.

#include "decision/pair_judging.h"

#include <algorithm>
#include <optional>
#include <vector>

namespace mapweave::fusion {

// Maps that accepted merges of pairs connect.
struct TeamMembers {
  std::vector<std::size_t> maps;  // numbers, rising
  std::vector<PairJoin*> joins;   // that are accepted, in the order of pairs
  std::size_t place_of(std::size_t map) const {
    return static_cast<std::size_t>(std::lower_bound(maps.begin(), maps.end(), map) - maps.begin());
  }
  bool contains(std::size_t map) const { return std::binary_search(maps.begin(), maps.end(), map); }
};

class TeamSolver {
 public:
  TeamSolver(const PairJudging& judging, const FusionInput& input, const FusionOptions& options)
      : input_(input), options_(options), judging_(judging), maps_(judging.maps()), seen_(judging.seen()) {}
  virtual ~TeamSolver() = default;
  TeamSolver(const TeamSolver&) = delete;
  TeamSolver& operator=(const TeamSolver&) = delete;

  // Of each member's map frame, about; the scale is by how much the map is rescaled. Joins that contradict the others
  // are refused: nullopt then.
  virtual std::optional<std::vector<Sim3>> place(const TeamMembers& members) const = 0;
  // Nodes, constraints, submaps and landmarks of all members, solved together from there.
  virtual void solve(const TeamMembers& members, const std::vector<Sim3>& team_from_map, Component& team) const = 0;
  // Whether it moved what cameras see, once the members' frames are known; lasers stay. Teams of cameras alone are
  // adjusted as they are solved.
  virtual bool adjust_cameras(const TeamMembers&, const std::vector<Sim3>&, Component&) const { return false; }

 protected:
  // Along a tree of the joins with most witnesses.
  struct Tree {
    std::vector<Sim3> team_from_map;     // of each member
    std::vector<PairJoin*> other_joins;  // that are no branches of it, strongest first
  };
  Tree strongest_tree(const TeamMembers& members) const;
  // The scale of a team is that of a laser, else of the first metric member, whoever is its first member.
  void rescale_to_metres(const TeamMembers& members, std::vector<Sim3>& team_from_map) const;
  // Within these maps, numbers rising; by their places among them.
  std::vector<ClaimedSighting> claimed_within(const std::vector<std::size_t>& maps) const;

  const FusionInput& input_;
  const FusionOptions& options_;
  const PairJudging& judging_;
  const std::vector<PreparedMap>& maps_;
  const std::deque<VisualMap>& seen_;

 private:
  bool is_metric(std::size_t map) const;
};

// First node of a map that its team has too: in space a team has no nodes but keyframes.
const std::pair<NodeId, Node>& first_within(const Map& map, const Map& team);
// The team's frame is the map frame of its lowest member: that one's first node stays where its map has it.
// Returns how the team was moved.
Pose3 back_to_lowest(const Map& lowest, Map& team);

}  // namespace mapweave::fusion
