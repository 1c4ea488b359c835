#pragma once
// The one message that tiers exchange and the store keeps (CVS III-A): new content and landmarks once, moved poses and
// new sightings after.

#include <mapweave/maps/judgement.h>
#include <mapweave/maps/landmarks_by_node.h>
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

// Every list is in ascending order of ids, no id twice. Removals come first when an update is applied; a removed node
// takes its sightings of landmarks along, so that a keyframe can go without a word on each landmark that it saw.
struct MapUpdate {
  Origin origin;
  std::uint64_t sequence = 0;           // counts from 1 per origin
  std::uint64_t base = 0;               // the sequence it builds on; 0: nothing
  std::vector<Node> nodes;              // new
  std::vector<MovedNode> moved;         // known ones whose belief changed
  std::vector<Submap> submaps;          // new, or grown and not yet frozen before
  std::vector<Constraint> constraints;  // new or changed
  std::vector<Judgement> judgements;    // new; not part of the Map
  std::vector<NodeId> removed_nodes;
  std::vector<SubmapId> removed_submaps;
  std::vector<ConstraintId> removed_constraints;
  std::vector<Landmark> landmarks;                // new, or changed beyond what a LandmarkChange says
  std::vector<LandmarkChange> changed_landmarks;  // known ones that moved or were seen again
  std::vector<LandmarkId> removed_landmarks;
  // Landmarks of other maps that this map's keyframes saw: new sightings, no points. Not part of the Map: whoever knows
  // both maps joins them.
  std::vector<LandmarkChange> borrowed;
  // Sound content that its sender no longer has, to stay bounded: whoever receives it may keep it. Not part of the Map,
  // where both stay as they are; the sender still says where such nodes move.
  std::vector<NodeId> forgotten_nodes;
  std::vector<LandmarkId> forgotten_landmarks;
  // Planar poses and constraints that floats hold exactly are written as floats (form 7): for maps whose numbers were
  // rounded to them. Not part of the Map; decode does not set it.
  bool in_floats = false;
};

// newer = updated(older, difference(older, newer)), bit for bit; difference(Map{}, map) is the whole map. Origin's
// tier, sequence and base are the caller's to fill in. Contract: two states of one map; payloads and frozen submaps
// that both hold are the same.
MapUpdate difference(const Map& older, const Map& newer);
// Throws Error(kBadInput) on what does not fit: another map's update, unknown ids, a changed payload or frozen submap,
// a frozen submap whose content is not what its hash says, landmarks, borrowed ones too, anchored in or seen by what is
// no keyframe, or outside of its picture. A node sent again with its own content is moved, a landmark sent again is
// replaced. Whether `base` fits is the caller's to know. Contract: lists in ascending order.
Map updated(Map older, const MapUpdate&);
// The same in place; where it throws, the map is as it was. Costs what the update touches, and what lies behind new or
// removed ids that are not the last ones: that is moved. An update that removes nodes looks through all that may hang
// on them.
void apply(Map&, const MapUpdate&);
// `known`: of the same map, and kept so. Of landmarks, those that hang on removed nodes are looked at alone.
void apply(Map&, LandmarksByNode& known, const MapUpdate&);

// The byte form (libs/maps/proto/mapweave.proto). Deterministic: equal updates give equal bytes; doubles are kept bit
// for bit, scans and keyframes share their geometry again. encode throws ContractViolation for what decode would refuse
// (numbers that are not finite, quaternions that are not unit, names that are not valid, lists out of order), so what
// was written can be read. decode takes bytes that nobody vouches for: it checks all of that, and sizes before it
// allocates, and throws Error(kCorrupt), or kUnsupported for a newer form; whether ids are known is for updated() to
// say.
std::string encode(const MapUpdate&);
MapUpdate decode_map_update(std::string_view bytes, const std::string& where);

std::string encode(const Judgement&);
Judgement decode_judgement(std::string_view bytes, const std::string& where);
std::string encode(const Verdict&);  // without `seconds`, which no two runs share
Verdict decode_verdict(std::string_view bytes, const std::string& where);

}  // namespace mapweave
