#pragma once
// What an edge sends of maps that it has merged (RecSLAM III-C, preparative fusion): of each place the scans that show
// it, and all else as it was solved.

#include <mapweave/fusion/fuse.h>

namespace mapweave::fusion {

struct ThinningOptions {
  double cell_m = 0.1, new_share = 0.01;
  int sightings = 1;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("cell_m", cell_m,
               "side in metres of the cells by which scans are compared; larger values take more walls for the same");
    v.fraction("new_share", new_share,
               "a scan is left out where at most this share of its walls, and of the space that it saw free, is new; "
               "larger values leave out more scans");
    v.integer("sightings", sightings, 1, 100,
              "scans that must show a place before it is no longer new; larger values keep more scans");
  }
};

struct ThinnedMaps {
  // Of each member, in their order: all nodes where the component has them, in the frame of the member's own map; those
  // that were left out without scan and constraint. Submaps hold the nodes that have scans; constraints between two
  // nodes sum up what the component holds between them and those that follow them.
  std::vector<Map> maps;
  std::optional<MergedMaps> merged;  // of two members or more
  std::size_t scans = 0, kept = 0;
  double walls_left_out = 0.0;  // share of the walls' cells that no scan that was kept shows, or shows beside it
};

// Whether thinned() takes it: a laser's map in the plane.
bool can_be_thinned(const Map&);

// `members`: the maps that were merged, in the order of the component's. Contract: all can be thinned, and lasers
// merged them (Component::merged) or it is one. Pure.
ThinnedMaps thinned(const Component&, const std::vector<const Map*>& members, const ThinningOptions&);

}  // namespace mapweave::fusion
