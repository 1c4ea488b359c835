#pragma once
// What the cloud asks of an edge before it joins everything: to judge pairs of maps that lie on two edges. Judgements
// are pure in two contents, so whoever makes them makes the same.

#include <mapweave/fusion/fuse.h>

#include <string>
#include <vector>

namespace mapweave::tiers {

struct JudgingTask {
  std::vector<fusion::FirstPair> pairs;  // of each, the edge holds one map
  std::vector<std::string> updates;      // encoded MapUpdates: of the maps that it does not hold what is to be judged
};

}  // namespace mapweave::tiers
