#pragma once
// Which group to which edge (RecSLAM IV-C).

#include <mapweave/scheduling/latency_model.h>

#include <cstdint>
#include <vector>

namespace mapweave::scheduling {

using Groups = std::vector<std::vector<std::uint32_t>>;  // members, ascending

// By group, the edge. Least predicted t_c: the largest of what groups take on their edges is as small as it can be
// (bottleneck assignment, since eq. 3 takes the maximum), where that does not make slower edges judge what lies on two.
// Capacities are kept. Throws Error kBadInput where groups do not fit on edges.
std::vector<std::uint32_t> place_optimally(const Latency&, const Groups&);
// Algorithm 3: groups in their order, each on the edge that is best for it among those that are left. Empty groups take
// an edge too.
std::vector<std::uint32_t> place_as_recslam(const Latency&, const Groups&);

// Every plan takes at least as long (t_c): a convex relaxation, solved by Ipopt. Robots may be divided between edges,
// edges may be used in part, all edges share the bandwidth of all. Seconds. Calls wait for each other.
double lower_bound_seconds(const Latency&);

}  // namespace mapweave::scheduling
