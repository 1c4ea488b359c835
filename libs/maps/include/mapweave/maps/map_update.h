#pragma once
// The one message that tiers exchange and the store keeps (DESIGN section 1, CVS III-A): new content once, moved poses
// after.

#include <mapweave/maps/judgement.h>
#include <mapweave/maps/map.h>

#include <string>
#include <string_view>

namespace mapweave {

struct Origin {
  TierId tier;
  MapId map;
};

struct MovedNode {
  NodeId id;
  Pose3 map_from_node;
};

struct MapUpdate {
  Origin origin;
  std::uint64_t sequence = 0;         // counts from 1 per origin
  std::uint64_t base = 0;             // the sequence it builds on; 0: nothing
  std::vector<Node> nodes;            // new, in id order
  std::vector<MovedNode> moved;       // known ones whose belief changed
  std::vector<Submap> submaps;        // new, or grown and not yet frozen before
  std::vector<Constraint> constraints;
  std::vector<Judgement> judgements;
  std::vector<NodeId> removed_nodes;
  std::vector<SubmapId> removed_submaps;
  std::vector<ConstraintId> removed_constraints;
};

// newer = updated(older, difference(older, newer)).
MapUpdate difference(const Map& older, const Map& newer);
// Throws Error(kBadInput) on what does not fit: unknown ids, a changed payload or frozen submap.
Map updated(Map older, const MapUpdate&);

// The byte form (libs/maps/proto/mapweave.proto). Deterministic: equal updates give equal bytes. decode checks everything
// (ids, sizes, finite numbers, unit quaternions, submaps naming known nodes of the same message are NOT checked: updated() does) and throws Error(kCorrupt).
std::string encode(const MapUpdate&);
MapUpdate decode_map_update(std::string_view bytes, const std::string& where);

std::string encode(const Judgement&);
Judgement decode_judgement(std::string_view bytes, const std::string& where);
std::string encode(const Verdict&);
Verdict decode_verdict(std::string_view bytes, const std::string& where);

}  // namespace mapweave
