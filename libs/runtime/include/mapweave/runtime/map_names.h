#pragma once
// Maps that come from files get names, and none shares a robot with another: fusing needs ids that differ.

#include <mapweave/maps/map.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace mapweave::runtime {

// A name for each file: its stem; where several have the same stem, the name of the folder it is in; where that is
// taken too, numbered in the order of paths ("map", "map-2"). The order of `paths` changes nothing. Throws
// Error(kBadInput) for a file given twice.
std::vector<MapId> names_of(const std::vector<std::filesystem::path>& paths);

// The same map under another id and with its robots renamed, content and belief untouched.
Map rekeyed(const Map&, MapId id, const std::function<RobotId(RobotId)>& renamed);

// Gives maps whose robots occur in another map of the list robots of their own: the map's id, or "<id>.<robot>" where
// it has several (cut to a name's length, and numbered where taken). Parts of one robot's log (alpha.1, alpha.2) stay
// that robot's. The answer is sorted by map id. `notes`: a line
// per renamed robot.
std::vector<Map> with_robots_apart(std::vector<Map> maps, std::vector<std::string>& notes);

}  // namespace mapweave::runtime
