#pragma once
// A map that is given by its path: what merge and export read.

#include <mapweave/maps/map.h>

#include <filesystem>
#include <vector>

namespace mapweave::runtime {

struct MapInput {
  std::vector<Map> maps;
  std::vector<std::filesystem::path> files;  // all that was read: of a map_server grid its image too
};

// A store (.mwdb), a map_server grid (.yaml), or a folder of results that holds a map.mwdb. A grid's map is called `name`; those of a store
// have their own names. Throws Error: kMissing for what is not there, kBadInput for anything else or a store without maps, what reading
// throws.
MapInput read_map_input(const std::filesystem::path& path, MapId name);

}  // namespace mapweave::runtime
