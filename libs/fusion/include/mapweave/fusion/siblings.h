#pragma once
// Maps of many cameras, each client's own: those of different cameras of one robot are tied (rig.h) before fuse() joins them with all
// others, and its result tells each by its own name again.

#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/fusion/rig.h>

#include <string>
#include <vector>

namespace mapweave::fusion {

struct SiblingMaps {
  std::vector<Map> maps;  // to be fused: tied ones, and the others as they were; by id
  // The tied map has the name of the member whose client began first, and its first node stays where that client has it, so that it keeps
  // both while the maps grow.
  struct Tied {
    MapId map;
    std::vector<MapId> members;  // sorted; at least two
  };
  std::vector<Tied> tied;          // by map
  std::vector<std::string> notes;  // why siblings stayed apart, for people
};

// Whose camera made a map says its first node. Where cameras were is known at their keyframes alone, so longer gaps between these are
// bridged than `longest_gap_s` says. Pure: neither the order of maps nor threads change a byte.
SiblingMaps tied_siblings(const std::vector<Map>& maps, const RigOptions& options, WorkerPool& pool);

// Each component then has the members of a tied map instead of it, with the transform and the lengths of each. `maps`: as they were.
void tell_apart(FusionResult& result, const std::vector<SiblingMaps::Tied>& all, const std::vector<Map>& maps);

}  // namespace mapweave::fusion
