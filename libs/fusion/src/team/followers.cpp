#include "followers.h"

#include <algorithm>

namespace mapweave::fusion {
namespace {

// Of a scan to one near it along the trajectory, as the map that was thinned had them.
constexpr double kStep_m = 0.02, kStep_rad = 0.005;

}  // namespace

std::vector<NodeId> constrained_nodes(const Map& map) {
  std::vector<NodeId> nodes;
  nodes.reserve(2 * map.constraints.size());
  for (const auto& entry : map.constraints) {
    nodes.push_back(entry.first.from);
    nodes.push_back(entry.first.to);
  }
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

bool is_follower(const Node& node, const std::vector<NodeId>& constrained) {
  return node.payload == nullptr && !std::binary_search(constrained.begin(), constrained.end(), node.id);
}

// The leader is of the same session: the node before, else the first one after.
Followers::Followers(Map& map) {
  const std::vector<NodeId> constrained = constrained_nodes(map);
  std::vector<const Node*> waiting;  // of a session whose first leader is still to come
  const Node* leader = nullptr;
  const auto follow = [&](const Node& node) {
    followers_.push_back({node, leader->id, between(leader->map_from_node, node.map_from_node)});
  };
  for (const auto& [id, node] : map.nodes) {
    if (leader != nullptr && leader->id.session != id.session) leader = nullptr;
    if (!waiting.empty() && waiting.front()->id.session != id.session) waiting.clear();
    if (!is_follower(node, constrained)) {
      leader = &node;
      for (const Node* one : waiting) follow(*one);
      waiting.clear();
    } else if (leader == nullptr) {
      waiting.push_back(&node);
    } else {
      follow(node);
    }
  }
  if (followers_.empty()) return;
  Table<NodeId, Node> left;
  left.reserve(map.nodes.size() - followers_.size());
  auto next = followers_.begin();
  for (const auto& [id, node] : map.nodes)
    if (next != followers_.end() && next->node.id == id)
      ++next;
    else
      left.set(id, node);
  map.nodes = std::move(left);
}

void Followers::put_back(Map& map) const {
  if (followers_.empty()) return;
  Table<NodeId, Node> all;
  all.reserve(map.nodes.size() + followers_.size());
  auto next = followers_.begin();
  const auto put_before = [&](const NodeId* id) {
    for (; next != followers_.end() && (id == nullptr || next->node.id < *id); ++next) {
      Node node = next->node;
      node.map_from_node = compose(map.nodes.find(next->leader)->map_from_node, next->leader_from_node);
      all.set(node.id, std::move(node));
    }
  };
  for (const auto& [id, node] : map.nodes) {
    put_before(&id);
    all.set(id, node);
  }
  put_before(nullptr);
  map.nodes = std::move(all);
  const Eigen::Matrix3d information =
      Eigen::Vector3d(1.0 / (kStep_m * kStep_m), 1.0 / (kStep_m * kStep_m), 1.0 / (kStep_rad * kStep_rad)).asDiagonal();
  std::vector<std::pair<ConstraintId, Constraint>> steps;
  for (const Follower& follower : followers_) {
    const ConstraintId id{ConstraintKind::odometry, follower.leader, follower.node.id, 0};
    steps.emplace_back(id, planar_constraint(id, planar(follower.leader_from_node), information));
  }
  map.constraints.set_all(std::move(steps));
}

}  // namespace mapweave::fusion
