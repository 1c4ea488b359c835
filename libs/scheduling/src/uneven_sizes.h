#pragma once
// How large groups are where edges are not equally fast.

#include <mapweave/scheduling/latency_model.h>

#include <cstdint>
#include <vector>

namespace mapweave::scheduling {

// Largest first, groups of 0 left out, as capacities allow. Were all robots alike, no robot could be given to another
// edge so that t_c (eq. 3) is less. The search begins with these sizes; they are the answer where edges are equally
// fast.
std::vector<std::uint32_t> uneven_sizes(const Problem&, const LatencyModel&, std::vector<std::uint32_t> sizes);

}  // namespace mapweave::scheduling
