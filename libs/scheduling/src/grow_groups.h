#pragma once
// A first grouping: seeds far from each other, from which groups grow by turns along their heaviest links.

#include "tabu_search.h"

namespace mapweave::scheduling {

// Sizes come near the bounds; rebalance() does the rest.
std::vector<std::uint32_t> grow_groups(const ContractedGraph&, const std::vector<SizeBounds>&, RandomBits&);

}  // namespace mapweave::scheduling
