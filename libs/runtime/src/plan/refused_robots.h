#pragma once
// Robots whose maps are never to be matched to each other (team.refuse, run --refuse).

#include <mapweave/runtime/run_configuration.h>

#include <set>
#include <utility>
#include <vector>

namespace mapweave::runtime {

// Reads pairs of planned robots from team.refuse; parts of one robot's log count each. The lower id stands first.
// Throws Error that says where the pair stands: kBadInput where it is no pair, names a robot that is not planned, or
// names one robot twice; kUsage for the same mistakes on the command line.
std::set<std::pair<RobotId, RobotId>> refused_robots(const std::vector<std::string>& pairs,
                                                     const std::vector<PlannedRobot>& robots, const Origins& origins);

}  // namespace mapweave::runtime
