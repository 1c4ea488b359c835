#pragma once
// What the cloud asks of an edge before it merges everything: to judge pairs of maps that lie on two edges. Judgements
// are pure in two contents, so whoever makes them makes the same.

#include <string>
#include <vector>

namespace mapweave::tiers {

// As it goes over the wire.
struct JudgingTask {
  std::string pairs;                 // encoded (maps/pair_to_judge.h): of each, the edge holds one map
  std::vector<std::string> updates;  // encoded MapUpdates: of the maps that it does not hold what is to be judged
};

}  // namespace mapweave::tiers
