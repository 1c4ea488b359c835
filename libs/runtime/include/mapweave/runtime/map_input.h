#pragma once
// A map that is given by its path: what merge, export and inspect read.

#include <mapweave/core/hash.h>
#include <mapweave/maps/map.h>
#include <mapweave/maps/map_identity.h>

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace mapweave::runtime {

struct MapInput {
  std::vector<Map> maps;
  std::vector<Map> members;  // of a team's store: the robots' own maps before they were merged; may be empty
  std::vector<std::filesystem::path> files;          // all files read, also the image of a map_server grid
  std::vector<std::string> notes;                    // for people: oddities of a grid
  std::map<std::string, std::string> metadata = {};  // metadata of a store
  MapIdentity identity = {};                         // identity of a store of one map
  std::set<Hash> vetoed = {};                        // of a journal: judgements that its server did not believe
};

// A store (.mwdb), a camera map server's journal (.mwj: its clients' own maps, one by one), a map_server grid (.yaml),
// or a folder of results that holds a map.mwdb. A grid's map is called `name`; those of stores and journals have their
// own names. Throws Error: kMissing for what is not there, kBadInput for anything else, or where there is no map in it,
// what reading throws.
MapInput read_map_input(const std::filesystem::path& path, MapId name);

// The folders of team maps in a folder of results of run or merge: team/, or team-1/, team-2/ ... where maps stayed
// apart (earlier versions: team/, team-1/ ...). Empty where there is none.
std::vector<std::filesystem::path> team_folders(const std::filesystem::path& results);

// What was given, of a folder of results the stores of its teams, which hold the robots' own maps.
struct GivenPath {
  std::filesystem::path path;
  std::string given_as;  // what that folder of results is called; else empty
};
std::vector<GivenPath> with_teams_of_results(const std::vector<std::filesystem::path>& paths);

}  // namespace mapweave::runtime
