#pragma once
// What a coordinator that is a program of its own sends to all others: which robot's data go to which edge, and how far
// the deployment is. The newest one counts, by its number.

#include <mapweave/core/ids.h>

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::runtime {

struct RunPlan;

struct LivePlan {
  std::uint64_t number = 0;  // 0: nobody has decided yet
  std::uint64_t since = 0;   // number of this deployment's first plan
  // All robots have ended: edges merge for good, and robots move only where an edge is lost.
  bool is_final = false;
  bool is_done = false;               // the team's map is written: robots end
  std::map<RobotId, TierId> edge_of;  // for robots that have come; empty id: no edge has room

  std::vector<RobotId> members(const TierId& edge) const;  // ascending
};

// The plan as JSON. decode throws Error: kCorrupt for what is not JSON, kBadInput for what is no plan.
std::string encode(const LivePlan&);
LivePlan decode_live_plan(std::string_view json, const std::string& where);

// Throws Error(kBadInput) where it names a robot or an edge that the configuration does not have.
void expect_of(const LivePlan&, const RunPlan&);

}  // namespace mapweave::runtime
