#pragma once
// What the cameras of a stored map saw of depth, by the logs that the map was made of.

#include <mapweave/core/progress.h>
#include <mapweave/maps/map.h>
#include <mapweave/runtime/run_configuration.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace mapweave::runtime {

// Where the robots' logs are: as the config.yaml says that lies beside the map or up to three folders above it; those
// that are still there.
std::map<RobotId, std::filesystem::path> logs_of_results(const std::filesystem::path& map_file);

// The robots of a map whose depth cameras and stereo pairs left keyframes.
std::vector<RobotId> robots_with_depth(const Map&);

// map.ply and map.dense.pcd (output.ply), map.bt and map.ot (output.octomap) into `folder`, which is there: of what
// keyframes of the robots with logs showed, and of slabs (OctoMaps alone). Answers what was not as expected, for
// people. Contract: there are such robots, or slabs and output.octomap. Throws Error: what reading a log throws,
// kBadInput for a log without the map's cameras, or where there is nothing to write.
std::vector<std::string> write_stored_depth(const std::filesystem::path& folder, const Map&,
                                            const std::map<RobotId, std::filesystem::path>& logs,
                                            std::vector<exporters::MapSlab> slabs, const RunConfiguration&, Progress&);

}  // namespace mapweave::runtime
