#include "refused_robots.h"

#include <mapweave/core/error.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/runtime/merge_requests.h>

#include <algorithm>
#include <string>

namespace mapweave::runtime {
namespace {

using Robots = std::set<RobotId>;

// That is called so, or all parts of it.
Robots planned(const std::string& name, const std::vector<PlannedRobot>& robots, const RequestPlace& place) {
  Robots found;
  std::set<std::string> names;
  for (const PlannedRobot& robot : robots) {
    if (robot.id.str() == name || robot.robot().str() == name) found.insert(robot.id);
    names.insert({robot.id.str(), robot.robot().str()});
  }
  if (!found.empty()) return found;
  std::string list;
  for (const std::string& one : names) list += (list.empty() ? "" : ", ") + one;
  const auto nearest = nearest_name(name, {names.begin(), names.end()});
  throw Error(place.code, "unknown robot '" + name + "'; the configuration has: " + list, place.where,
              nearest ? "did you mean '" + *nearest + "'?" : "name robots of this run");
}

}  // namespace

std::set<std::pair<RobotId, RobotId>> refused_robots(const std::vector<std::string>& pairs,
                                                     const std::vector<PlannedRobot>& robots, const Origins& origins) {
  std::set<std::pair<RobotId, RobotId>> refused;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::string where = origins.place_of("team.refuse." + std::to_string(i));
    const RequestPlace place{where == kRefuseFlag ? ErrorCode::kUsage : ErrorCode::kBadInput, where};
    const auto [one, other] = parse_pair(pairs[i], place);
    const Robots of_one = planned(one, robots, place), of_other = planned(other, robots, place);
    for (const RobotId& a : of_one)
      for (const RobotId& b : of_other) {
        if (a == b)
          throw Error(place.code, "'" + one + "' and '" + other + "' are one robot", place.where, "name two robots");
        refused.insert(std::minmax(a, b));
      }
  }
  return refused;
}

}  // namespace mapweave::runtime
