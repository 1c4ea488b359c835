#include "owned_update.h"

#include <mapweave/core/error.h>
#include <mapweave/visual/borrowing.h>

namespace mapweave::tiers {
namespace {

constexpr double kFarthest_m = 1e6;  // from a map's origin

}  // namespace

void expect_own_map(const MapId& map, const ClientId& client, const std::string& where) {
  if (!visual::session_of(client, map))
    throw Error(ErrorCode::kBadInput, "map '" + map.str() + "' is not one of its own", where,
                "a client publishes its own map alone");
}

void expect_owned(const MapUpdate& update, const SessionId& owner, const std::string& where) {
  const auto expect = [&](const SessionId& session, const std::string& what) {
    if (session != owner)
      throw Error(ErrorCode::kBadInput, what + " is not of " + to_string(owner), where,
                  "a client publishes its own map alone");
  };
  const auto expect_seen = [&](const std::vector<LandmarkSighting>& seen) {
    for (const LandmarkSighting& sighting : seen) expect(sighting.node.session, to_string(sighting.node));
  };
  const auto expect_near = [&](const Pose3& pose, const NodeId& id) {
    if (!(pose.t.norm() < kFarthest_m))
      throw Error(ErrorCode::kBadInput, to_string(id) + " is farther than any robot goes", where,
                  "a client begins near its origin");
  };
  for (const Node& node : update.nodes) {
    expect(node.id.session, to_string(node.id));
    expect_near(node.map_from_node, node.id);
    if (keyframe_of(node) == nullptr)
      throw Error(ErrorCode::kBadInput, to_string(node.id) + " is no keyframe", where,
                  "cameras publish keyframes and landmarks");
  }
  for (const MovedNode& moved : update.moved) {
    expect(moved.id.session, to_string(moved.id));
    expect_near(moved.map_from_node, moved.id);
  }
  for (const NodeId& id : update.removed_nodes) expect(id.session, to_string(id));
  for (const Landmark& landmark : update.landmarks) {
    expect(landmark.id.session, to_string(landmark.id));
    expect_seen(landmark.seen);
  }
  for (const LandmarkChange& change : update.changed_landmarks) {
    expect(change.id.session, to_string(change.id));
    expect_seen(change.seen);
  }
  for (const LandmarkId& id : update.removed_landmarks) expect(id.session, to_string(id));
  for (const NodeId& id : update.forgotten_nodes) expect(id.session, to_string(id));
  for (const LandmarkId& id : update.forgotten_landmarks) expect(id.session, to_string(id));
  for (const LandmarkChange& borrowed : update.borrowed) expect_seen(borrowed.seen);
  if (!update.submaps.empty() || !update.constraints.empty() || !update.judgements.empty() ||
      !update.removed_submaps.empty() || !update.removed_constraints.empty())
    throw Error(ErrorCode::kBadInput, "a camera's update holds submaps, constraints or judgements", where,
                "cameras publish keyframes and landmarks");
}

}  // namespace mapweave::tiers
