#pragma once
// Which of many measurements hold together: the heaviest clique of pairwise consistent ones (pairwise consistent
// measurement set maximisation, Mangelson et al., ICRA 2018).

#include <cstddef>
#include <vector>

namespace mapweave::graph {

// consistent[i * n + j]: whether i and j agree (symmetric; the diagonal is ignored). weights > 0. Exact within the
// budget of search steps, else the best found. Among equals the first found: the same input gives the same set. Returns
// numbers in ascending order.
std::vector<std::size_t> consistent_set(const std::vector<bool>& consistent, const std::vector<double>& weights,
                                        std::size_t budget = 200000);

}  // namespace mapweave::graph
