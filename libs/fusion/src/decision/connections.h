#pragma once
// What is said of two maps that lie in one team map, matched to each other or through others.

#include "pair_judging.h"

#include <vector>

namespace mapweave::fusion {

// Fills Verdict::in_one_map; of maps that lie in different teams it takes Verdict::merge away.
void note_connections(const std::vector<Component>& components, std::vector<PairJoin>& pairs);

}  // namespace mapweave::fusion
