#pragma once
// The coordinator's decision: groups, their edges, what that is expected to take, and what no plan can undercut.

#include <mapweave/scheduling/grouping.h>
#include <mapweave/scheduling/placement.h>

#include <string>
#include <vector>

namespace mapweave::scheduling {

enum class PlanMethod { standard, recslam, greedy, random, metis, exact };
const std::vector<std::string>& plan_method_names();  // "default", "recslam", ... in the order of PlanMethod

struct PlanOptions {
  PlanMethod method = PlanMethod::standard;
  std::uint64_t seed = 1;
  LatencyModel model;
  RecslamOptions recslam = {};  // of that method
  // Partial offloading (RecSLAM III-B): to how many edges each robot sends its data, so that one edge fewer than this
  // may fail. The further ones are those that are done soonest with it.
  std::uint32_t edges_per_robot = 1;
};

// Methods default and exact make groups that are less equal than group_sizes() where edges differ in speed and that
// saves more than a twentieth of the time; an edge may stay without robots.
struct Plan {
  Groups groups;                                              // members ascending, by first member; none is empty
  std::vector<std::uint32_t> edge_of;                         // by robot
  std::vector<std::vector<std::uint32_t>> further_edges_of;   // by robot; empty without partial offloading
  double cut_weight = 0.0, in_group_weight = 0.0;             // each link once
  double predicted_seconds = 0.0, lower_bound_seconds = 0.0;  // t_c, eq. 3
  double algorithm_seconds = 0.0;                             // processor time of grouping and placement
};

// Pure but for algorithm_seconds. Throws Error kBadInput or kUsage where a method cannot do what is asked, naming
// another.
Plan make_plan(const Problem&, const PlanOptions&);

}  // namespace mapweave::scheduling
