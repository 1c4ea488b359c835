#pragma once
// How far the trajectories are from true ones.

#include "encoding.h"
#include "map_data.h"

#include <filesystem>

namespace mapweave::report {

struct ReferenceErrors {
  Json errors = Json::array();  // a line for each robot
  std::string alignment;        // in words; empty where there is no reference
};

// Compares the first map's trajectories, all laid on their references by one motion, and adds the references to that
// map. Throws Error: kMissing where there is none of any robot, kUsage for one file of several robots.
ReferenceErrors reference_errors(const std::filesystem::path& reference, const std::vector<std::string>& robots,
                                 std::vector<ReportMap>& maps);

}  // namespace mapweave::report
