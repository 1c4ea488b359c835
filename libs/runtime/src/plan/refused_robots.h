#pragma once
// Robots whose maps are never to be matched to each other (team.refuse, run --refuse).

#include <mapweave/runtime/run_configuration.h>

#include <set>
#include <utility>
#include <vector>

namespace mapweave::runtime {

// The pairs of team.refuse, of planned robots: parts of a log each for itself, the lower id first. Throws Error, saying
// where it stands: kBadInput for what is no pair, names a robot that is none of these, or one robot twice; kUsage for
// the same of the command line.
std::set<std::pair<RobotId, RobotId>> refused_robots(const std::vector<std::string>& pairs,
                                                     const std::vector<PlannedRobot>& robots, const Origins& origins);

}  // namespace mapweave::runtime
