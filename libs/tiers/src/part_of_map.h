#pragma once
// What of a map is sent to be judged.

#include <mapweave/fusion/fuse.h>
#include <mapweave/maps/pair_to_judge.h>

#include <set>

namespace mapweave::tiers {

// These submaps with their nodes.
Map part_of(const Map& map, const std::set<SubmapId>& submaps);
PairToJudge as_sent(const fusion::FirstPair& pair);
Map map_in(std::string_view update, const std::string& where);

}  // namespace mapweave::tiers
