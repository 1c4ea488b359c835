#pragma once
// What `export` is asked to write of a map, and whether the map can give it.

#include <mapweave/exporters/map_folder.h>
#include <mapweave/maps/map.h>
#include <mapweave/runtime/run_configuration.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace mapweave::app {

struct ExportRequest {
  exporters::MapFolderFiles files;
  bool ply = false, octomap = false;
  bool is_explicit = false;                       // by flags: what cannot be written is an error, and not left out
  std::map<RobotId, std::filesystem::path> logs;  // for depth
  bool wants_depth() const { return ply || octomap; }
};

// Without any of the flags all that `output` switches on, as far as the map can give it.
ExportRequest request_of(const exporters::MapFolderFiles& flags, bool ply, bool octomap,
                         const runtime::OutputOptions& output);

// The request without what the map cannot give. Throws Error(kBadInput), saying what is needed, where that was asked
// for by its flag (of depth: always), and where nothing is left. An OctoMap of walls goes without the depth of robots
// whose logs are not known.
ExportRequest possible(ExportRequest, const Map&);
// The robots of that depth.
std::vector<RobotId> without_log(const ExportRequest&, const Map&);

// Whether a laser's scans or a grid show walls, so that one can be drawn.
bool has_walls(const Map&);

// One robot of a team, where the team has it. Throws Error(kUsage), naming the map's robots, for one that it has not.
Map part_of_robot(const Map&, const std::string& robot);

// "ROBOT=PATH", or "PATH" for a map of one robot with depth. Throws Error: kUsage for others, kMissing for a log that
// is not there.
std::map<RobotId, std::filesystem::path> given_logs(const std::vector<std::string>& texts,
                                                    const std::vector<RobotId>& robots);

}  // namespace mapweave::app
