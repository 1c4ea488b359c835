#pragma once
// Maps of many cameras of many robots, each client's own: those of different cameras of one robot become one map of the
// rig (rig.h). fuse() then merges these with all others; fusion/split_rigs.h splits its result into the clients' own
// maps again.

#include <mapweave/core/worker_pool.h>
#include <mapweave/rig/rig.h>

#include <string>
#include <vector>

namespace mapweave::rig {

struct RobotRigs {
  std::vector<Map> maps;  // to be fused: maps of rigs, and the others as they were; by id
  // The map of a rig has the id of the member whose client began first. The first node of this member stays where the
  // client has it, so that id and frame persist while the maps grow.
  struct Rig {
    MapId map;
    std::vector<MapId> members;  // sorted; at least two
  };
  std::vector<Rig> rigs;           // by map
  std::vector<std::string> notes;  // why cameras of one rig stayed apart, for people
};

// The first node of a map names its camera. Poses are known at keyframes alone, so longer gaps between them are bridged
// than `longest_gap_s` says. Pure: neither the order of maps nor threads change a byte.
RobotRigs merge_rigs(const std::vector<Map>& maps, const RigOptions& options, WorkerPool& pool);

}  // namespace mapweave::rig
