#pragma once
// The nouns of a map. Content (scans, keyframes, frozen submaps) never changes once frozen; belief (poses, constraints,
// landmarks) is recomputed. Grids, pyramids, clouds and pictures are caches of content under a belief.

#include <mapweave/core/geometry.h>
#include <mapweave/core/hash.h>
#include <mapweave/core/ids.h>
#include <mapweave/core/stamp.h>
#include <mapweave/maps/keyframe.h>
#include <mapweave/maps/landmark.h>
#include <mapweave/maps/occupancy_grid.h>
#include <mapweave/maps/scan.h>
#include <mapweave/maps/table.h>

#include <memory>
#include <optional>
#include <variant>
#include <vector>

namespace mapweave {

// What was sensed at a node. The grid of a map_server file is in the node's frame.
using Payload = std::variant<PackedScan, OccupancyGrid, KeyframeFeatures>;

struct Node {
  NodeId id;
  Stamp stamp;
  Pose3 map_from_node;                     // belief; the node's frame is the robot base
  std::shared_ptr<const Payload> payload;  // content; null for a pose only (a scan that showed nothing new)
};

// What a camera saw there; null where the node is no keyframe.
inline const KeyframeFeatures* keyframe_of(const Node& node) {
  return std::get_if<KeyframeFeatures>(node.payload.get());
}

// The unit of matching: some nodes, held together rigidly. The submap's frame is that of its first node.
struct Submap {
  SubmapId id;
  std::vector<std::pair<NodeId, Pose3>>
      submap_from_node;  // of nodes with payloads; the first is the anchor, at identity
  bool frozen = false;
  Hash content;  // of payloads and submap_from_node; set when frozen
  const NodeId& anchor() const { return submap_from_node.front().first; }
};

enum class ConstraintKind : std::uint8_t {
  odometry = 0,
  scan_match = 1,
  extrinsic = 2,
  loop = 3,
  between_maps = 4,
  prior = 5
};

struct ConstraintId {  // of `from` to `to`, one of each kind, counted where there are several
  ConstraintKind kind = ConstraintKind::odometry;
  NodeId from, to;
  std::uint32_t index = 0;
};
// By the node that was there last: a map that grows appends.
inline auto key_of(const ConstraintId& id) { return std::tie(id.to, id.kind, id.from, id.index); }

struct Constraint {
  ConstraintId id;
  Sim3 from_from_to;
  // Order (x, y, z, roll, pitch, yaw) of a small motion of `to` in its own frame; 1/m^2, 1/rad^2; may be rank
  // deficient. Planar constraints fill x, y, yaw and leave the other rows zero.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  std::optional<Hash> because;  // the judgement it rests on (loop, between_maps)
};

// Builds a planar constraint; information in order (x, y, yaw) in the frame of `to`.
Constraint planar_constraint(ConstraintId id, const Pose2& from_from_to, const Eigen::Matrix3d& information);

// One map: of one session (a robot's own), or of several that were fused. A value; payloads are shared between copies.
struct Map {
  MapId id;
  Table<NodeId, Node> nodes;
  Table<SubmapId, Submap> submaps;
  Table<ConstraintId, Constraint> constraints;
  Table<LandmarkId, Landmark> landmarks;  // anchored in and seen by keyframes among the nodes

  bool empty() const { return nodes.empty(); }
  std::vector<SessionId> sessions() const;  // sorted
  std::vector<RobotId> robots() const;      // sorted
};

// Whether a judgement's side is of this map: one of its submaps, or a keyframe, which is named by its session and
// index.
bool holds(const Map&, const SubmapId&);

// Hash of content alone (nodes' ids, stamps and payloads, frozen submaps; in id order): equal for maps that differ in
// belief only.
Hash content_hash(const Map&);
// Hash of a frozen submap's content: its nodes' ids, places in it and payloads. Throws ContractViolation when a node
// has no payload.
Hash content_hash(const Submap&, const Table<NodeId, Node>&);

}  // namespace mapweave
