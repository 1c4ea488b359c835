#pragma once
// The maps of a folder of results: grids, trajectories, loops, joins, conflicts, points.

#include "encoding.h"
#include "point_data.h"
#include "result_files.h"

#include <mapweave/core/geometry.h>
#include <mapweave/evaluation/trajectory.h>

#include <string>
#include <vector>

namespace mapweave::report {

struct RobotTrajectory {
  std::size_t robot;  // place in ReportMaps::robots
  evaluation::Trajectory poses;
};

struct ReportMap {
  std::string folder;       // "team", "robots/alpha"; "" is the folder itself
  std::string kind;         // team, robot, cameras (of a robot that has a laser, too)
  std::string name, title;  // name: as merges.json has it
  std::vector<RobotTrajectory> trajectories;
  std::vector<RobotTrajectory> references;  // in the map's frame
  std::vector<ReportPoint> points;
  std::string points_file;
  Json json;  // what is in its final form already
};

// The robots of the folder, sorted by name: of summary.json, else by the names of folders and files.
std::vector<std::string> robot_names(const ResultFiles&, const Json& summary);

// Team maps first. Reads all but stores of maps that have no pose graph to show.
std::vector<ReportMap> read_maps(ResultFiles&, const std::vector<std::string>& robots, const Json& summary,
                                 const Json& merges);

// All maps in their final form, with poses and points thinned so that they take no more than `most_bytes` together.
Json maps_json(const std::vector<ReportMap>&, std::size_t most_bytes);

}  // namespace mapweave::report
