#pragma once
// What users ask of a deployment while it runs. It counts in place of what the configuration says of the same.

#include <mapweave/runtime/run_configuration.h>

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>

namespace mapweave::runtime {

struct LiveRequests {
  std::set<std::pair<RobotId, RobotId>> refused;  // pairs never to be matched, beside configured ones; lower id first
  std::map<RobotId, StartPose> starts;            // where robots began, in the frame that all starts share
};

// The requests as JSON. decode throws Error: kCorrupt for what is not JSON, kBadInput for what is no request, and for
// robots that the plan does not have.
std::string encode(const LiveRequests&);
LiveRequests decode_live_requests(std::string_view json, const RunPlan& plan, const std::string& where);

// What the configuration or, if it was asked for, a request says of a robot's start.
StartPose start_of(const RunConfiguration&, const LiveRequests&, const RobotId&);
// The plan's refused pairs and those that were asked for.
std::set<std::pair<RobotId, RobotId>> refused_in(const RunPlan&, const LiveRequests&);

}  // namespace mapweave::runtime
