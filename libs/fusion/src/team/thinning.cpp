#include "scan_coverage.h"

#include <mapweave/fusion/thinning.h>
#include <mapweave/maps/alignment.h>
#include <mapweave/maps/in_floats.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <map>
#include <set>

namespace mapweave::fusion {
namespace {

// Anchors of submaps, and of each session the first node with a scan: whatever they show.
std::set<NodeId> always_kept(const std::vector<const Map*>& members) {
  std::set<NodeId> kept;
  for (const Map* map : members) {
    for (const auto& entry : map->submaps) kept.insert(entry.second.anchor());
    const SessionId* last = nullptr;
    for (const auto& [id, node] : map->nodes) {
      if (node.payload == nullptr || (last != nullptr && *last == id.session)) continue;
      kept.insert(id);
      last = &id.session;
    }
  }
  return kept;
}

std::set<NodeId> chosen_scans(const Table<NodeId, Node>& nodes, const std::vector<const Map*>& members,
                              const ThinningOptions& options, ThinnedMaps& result) {
  ScanCoverage coverage(nodes, options.cell_m, options.sightings);
  std::set<NodeId> kept = always_kept(members);
  for (const NodeId& id : kept) coverage.add(coverage.sight_of(*nodes.find(id)));
  for (const auto& [id, node] : nodes) {
    if (node.payload == nullptr) continue;
    ++result.scans;
    if (kept.count(id) != 0) continue;
    const ScanCoverage::Sight sight = coverage.sight_of(node);
    if (coverage.new_share(sight) > options.new_share) {
      coverage.add(sight);
      kept.insert(id);
    } else {
      coverage.leave_out(sight);
    }
  }
  result.kept = kept.size();
  result.walls_left_out = coverage.left_out();
  return kept;
}

// What the component holds between nodes that are kept and all that follow them, each pair summed up: at the
// component's poses it pulls as all of them together.
class SummedConstraints {
 public:
  SummedConstraints(const Map& team, const std::set<NodeId>& kept) : team_(team) {
    const NodeId* leader = nullptr;
    std::vector<NodeId> waiting;
    for (const auto& [id, node] : team.nodes) {
      if (leader != nullptr && leader->session != id.session) leader = nullptr;
      if (kept.count(id) != 0) {
        leader = &id;
        for (const NodeId& one : waiting) leader_of_.emplace(one, id);
        waiting.clear();
      }
      if (leader != nullptr)
        leader_of_.emplace(id, *leader);
      else
        waiting.push_back(id);
    }
    for (const auto& entry : team.constraints) add(entry.second);
  }

  std::vector<Constraint> take() const {
    std::vector<Constraint> constraints;
    for (const auto& [id, sum] : sums_) {
      const Pose2 now = between(pose_of(id.from), pose_of(id.to));
      const Eigen::Matrix3d damped = sum.information + 1e-6 * Eigen::Matrix3d::Identity();
      const Eigen::Vector3d off = damped.ldlt().solve(sum.pull);
      const Pose2 measured = compose(now, inverse(Pose2{off.x(), off.y(), off.z()}));
      constraints.push_back(planar_constraint(id, in_floats(measured), in_floats(sum.information)));
    }
    return constraints;
  }

 private:
  struct Sum {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d pull = Eigen::Vector3d::Zero();
  };
  Pose2 pose_of(const NodeId& id) const { return planar(team_.nodes.find(id)->map_from_node); }

  void add(const Constraint& constraint) {
    const NodeId &from = leader_of_.at(constraint.id.from), &to = leader_of_.at(constraint.id.to);
    if (from == to) return;
    const bool is_odometry = constraint.id.kind == ConstraintKind::odometry;
    const bool is_own_submap = constraint.id.kind == ConstraintKind::scan_match && constraint.id.index == 0;
    // Loops that were found are no longer in doubt.
    const ConstraintId id{is_odometry ? ConstraintKind::odometry : ConstraintKind::scan_match, from, to,
                          is_odometry || is_own_submap ? 0U : 1U};
    const Pose2 from_leader = between(pose_of(from), pose_of(constraint.id.from)),
                to_leader = between(pose_of(to), pose_of(constraint.id.to));
    const Pose2 measured = compose(compose(from_leader, planar(constraint.from_from_to.pose)), inverse(to_leader));
    const Pose2 error = between(measured, between(pose_of(from), pose_of(to)));
    const Eigen::Matrix3d carry = adjoint(inverse(to_leader));
    const Eigen::Matrix3d information = carry.transpose() * planar(constraint.information) * carry;
    Sum& sum = sums_[id];
    sum.information += information;
    sum.pull += information * Eigen::Vector3d(error.x, error.y, error.phi);
  }

  const Map& team_;
  std::map<NodeId, NodeId> leader_of_;
  std::map<ConstraintId, Sum> sums_;
};

Map without_others(const Map& own, const Map& team, const Pose3& own_from_team, const std::set<NodeId>& kept) {
  Map map;
  map.id = own.id;
  map.nodes.reserve(own.nodes.size());
  for (const auto& [id, node] : own.nodes) {
    Node sent = node;
    sent.map_from_node = in_floats(compose(own_from_team, team.nodes.find(id)->map_from_node));
    if (kept.count(id) == 0) sent.payload = nullptr;
    map.nodes.set(id, std::move(sent));
  }
  for (const auto& [id, submap] : own.submaps) {
    Submap sent = submap;
    auto& nodes = sent.submap_from_node;
    nodes.erase(
        std::remove_if(nodes.begin(), nodes.end(), [&](const auto& node) { return kept.count(node.first) == 0; }),
        nodes.end());
    for (auto& member : nodes) member.second = in_floats(member.second);
    if (sent.frozen) sent.content = content_hash(sent, map.nodes);
    map.submaps.set(id, std::move(sent));
  }
  return map;
}

}  // namespace

bool can_be_thinned(const Map& map) {
  const auto is_laser = [](const Node& node) {
    return is_planar(node.map_from_node) && (!node.payload || std::holds_alternative<PackedScan>(*node.payload));
  };
  const auto is_known = [](const ConstraintId& id) {
    return id.kind == ConstraintKind::odometry || id.kind == ConstraintKind::scan_match ||
           id.kind == ConstraintKind::loop || id.kind == ConstraintKind::between_maps;
  };
  std::set<SessionId> with_scans;
  for (const auto& [id, node] : map.nodes)
    if (node.payload != nullptr) with_scans.insert(id.session);
  return !map.submaps.empty() && map.landmarks.empty() && with_scans.size() == map.sessions().size() &&
         std::all_of(map.nodes.begin(), map.nodes.end(), [&](const auto& entry) { return is_laser(entry.second); }) &&
         std::all_of(map.constraints.begin(), map.constraints.end(),
                     [&](const auto& entry) { return is_known(entry.first); });
}

ThinnedMaps thinned(const Component& component, const std::vector<const Map*>& members,
                    const ThinningOptions& options) {
  MAPWEAVE_EXPECT(members.size() == component.members.size(), "each member has its map");
  MAPWEAVE_EXPECT(members.size() == 1 || component.merged, "lasers merged the members");
  ThinnedMaps result;
  const std::set<NodeId> kept = chosen_scans(component.map.nodes, members, options, result);
  std::map<SessionId, std::size_t> member_of;
  for (std::size_t i = 0; i < members.size(); ++i) {
    const Pose3 own_from_team = inverse(*component.team_from_map.find(members[i]->id));
    result.maps.push_back(without_others(*members[i], component.map, own_from_team, kept));
    for (const SessionId& session : members[i]->sessions()) member_of.emplace(session, i);
  }
  result.merged = component.merged;
  for (Constraint& constraint : SummedConstraints(component.map, kept).take()) {
    const std::size_t from = member_of.at(constraint.id.from.session), to = member_of.at(constraint.id.to.session);
    if (from == to)
      result.maps[from].constraints.set(constraint.id, std::move(constraint));
    else
      result.merged->constraints.push_back(std::move(constraint));
  }
  return result;
}

}  // namespace mapweave::fusion
