#pragma once
// Of which maps all scans may decide what some of them could not.

#include <mapweave/fusion/fuse.h>

#include <set>

namespace mapweave::tiers {

// Maps of lasers that match and stayed apart, though they may lie to each other as a verdict says.
std::set<MapId> maps_in_doubt(const fusion::FusionResult& result);

}  // namespace mapweave::tiers
