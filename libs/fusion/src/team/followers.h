#pragma once
// Poses without a scan that no constraint holds (thinning.h leaves them): they follow the node before them.

#include <mapweave/maps/map.h>

#include <vector>

namespace mapweave::fusion {

bool is_follower(const Node& node, const std::vector<NodeId>& constrained);  // sorted
// Nodes that a constraint names, sorted.
std::vector<NodeId> constrained_nodes(const Map& map);

class Followers {
 public:
  // Takes them out of the map, with where they lie to their leaders.
  explicit Followers(Map& map);
  // With a constraint each that holds them to their leaders.
  void put_back(Map& map) const;

 private:
  struct Follower {
    Node node;
    NodeId leader;
    Pose3 leader_from_node;
  };
  std::vector<Follower> followers_;  // by id
};

}  // namespace mapweave::fusion
