#pragma once
// What a tier found between maps that it merged, for who merges them with others (RecSLAM III-C, preparative fusion).
// Byte form: as exchange.h.

#include <mapweave/maps/judgement.h>
#include <mapweave/maps/map.h>

#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

// Two submaps, of two maps or of one, that lie so.
struct MatchedSubmaps {
  SubmapId from, to;
  Pose2 from_from_to;
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();  // x, y, yaw in the frame of `to`
  double probability = 0.0;
  bool is_observable = true;  // in all directions; along a bare corridor a match can slide
  Hash judgement;
  bool overrules_own = false;  // of one map: what that map says of these places and those beside them is left out
};

// One group of maps was merged with another.
struct MergedGroups {
  std::vector<MapId> one, other;  // sorted
  double probability = 0.0;
  std::string proposer;  // as in a verdict
};

struct MergedMaps {
  std::vector<MapId> members;        // sorted, two or more
  std::vector<MergedGroups> merges;  // in the order in which they were decided
  std::vector<MatchedSubmaps> matches;
  std::vector<Judgement> judgements;    // that the matches rest on, sorted by id
  std::vector<Constraint> constraints;  // between nodes of two members, solved already; sorted
};

// decode takes bytes that nobody vouches for, and throws Error(kCorrupt) for what is not sound: members, matches or
// merges that name others than the members, or a match without its judgement. Whether maps, submaps and nodes are known
// is for the receiver to say.
std::string encode(const MergedMaps&);
MergedMaps decode_merged_maps(std::string_view bytes, const std::string& where);

}  // namespace mapweave
