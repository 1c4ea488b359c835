#include "given_maps.h"

#include <mapweave/core/error.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/fusion/raster_doubt.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/mapdb/update_journal.h>
#include <mapweave/runtime/map_input.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/tiers/visual_server.h>

#include <algorithm>
#include <limits>

namespace mapweave::runtime {
namespace {

// Merging takes minutes and gigabytes for more: not for what looks like no map.
constexpr std::ptrdiff_t kMostDoubtfulWalls = 4'000'000;

// What a server that goes on from there would have of its clients, on its disk too.
MapInput journal_input(const std::filesystem::path& path) {
  MapInput input;
  mapdb::UpdateJournal journal = mapdb::UpdateJournal::left_behind(path);
  tiers::ServerOptions options;
  options.keyframes = std::numeric_limits<int>::max();
  tiers::VisualServer server(TierId("journal"), options, {});
  journal.replay([&](const mapdb::JournalEntry& entry) {
    if (entry.vetoed) {
      input.vetoed.insert(*entry.vetoed);
      return;
    }
    try {
      server.greet({entry.from, server.vocabulary()});
      server.receive(entry.from, entry.update);
    } catch (const Error& error) {
      throw Error(ErrorCode::kCorrupt, std::string("an update of it does not fit: ") + error.what(), path.string(),
                  "take an undamaged copy of the journal");
    }
  });
  input.maps = server.maps();
  input.files = mapdb::UpdateJournal::files_of(path);
  return input;
}

// Stores of earlier versions do not say it; what made them would give them that of a new map today.
MapIdentity identity_of(const std::map<std::string, std::string>& metadata, const MapIdentity& otherwise) {
  const auto id = metadata.find("map_id"), version = metadata.find("map_version");
  if (id == metadata.end() || version == metadata.end()) return otherwise;
  const std::string& digits = version->second;
  constexpr std::size_t kMostDigits = 18;
  if (!is_valid_name(id->second) || digits.empty() || digits.size() > kMostDigits ||
      digits.find_first_not_of("0123456789") != std::string::npos)
    return otherwise;
  return {id->second, std::max<std::uint64_t>(1, std::stoull(digits)), otherwise.content};
}

MapInput grid_input(const std::filesystem::path& path, const MapId& name) {
  const OccupancyGrid grid = exporters::read_map_server(path);
  if (std::all_of(grid.log_odds.begin(), grid.log_odds.end(),
                  [](std::int16_t cell) { return cell == OccupancyGrid::kUnknown; }))
    throw Error(ErrorCode::kBadInput, "every cell of the grid is unknown", path.string(),
                "check its image and its thresholds");
  const std::string doubt = fusion::doubt_of_raster(grid);
  const auto walls = std::count_if(grid.log_odds.begin(), grid.log_odds.end(),
                                   [](std::int16_t cell) { return cell > OccupancyGrid::kUnknown; });
  if (!doubt.empty() && walls > kMostDoubtfulWalls)
    throw Error(ErrorCode::kBadInput, doubt + ", and has " + std::to_string(walls) + " cells of wall", path.string(),
                "check its image and its thresholds");
  MapInput input{{fusion::map_of_grid(name, grid)}, {}, {path, exporters::image_of_map_server(path)}, {}};
  input.identity = identity_of(exporters::identity_of_map_server(path), {});
  if (!doubt.empty()) input.notes = {path.string() + " " + doubt + ": check its image and its thresholds"};
  return input;
}

}  // namespace

std::vector<std::filesystem::path> team_folders(const std::filesystem::path& results) {
  std::vector<std::filesystem::path> folders;
  const auto add = [&](const std::string& name) {
    std::error_code ignored;
    if (!std::filesystem::exists(results / name / "map.mwdb", ignored)) return false;
    folders.push_back(results / name);
    return true;
  };
  add("team");
  for (int i = 1; add("team-" + std::to_string(i));) ++i;
  return folders;
}

std::vector<GivenPath> with_teams_of_results(const std::vector<std::filesystem::path>& paths) {
  std::vector<GivenPath> result;
  for (const std::filesystem::path& path : paths) {
    std::error_code ignored;
    const std::vector<std::filesystem::path> teams = team_folders(path);
    const std::string name = name_of_file(std::filesystem::weakly_canonical(path, ignored));
    for (const std::filesystem::path& team : teams)
      result.push_back({team / "map.mwdb", team == teams.front() ? name : name + "/" + team.filename().string()});
    if (teams.empty()) result.push_back({path, ""});
  }
  return result;
}

MapInput read_map_input(const std::filesystem::path& path, MapId name) {
  std::error_code problem, ignored;
  const auto status = std::filesystem::status(path, problem);
  if (!std::filesystem::exists(status))
    throw Error(ErrorCode::kMissing,
                status.type() == std::filesystem::file_type::not_found ? "is not there"
                                                                       : "cannot be read: " + problem.message(),
                path.string(), "check the path");
  if (std::filesystem::is_directory(status)) {
    if (!std::filesystem::exists(path / "map.mwdb", ignored))
      throw Error(ErrorCode::kBadInput, "is a folder without a map.mwdb", path.string(),
                  team_folders(path).empty()
                      ? "name a map (.mwdb), a journal (.mwj), a map_server grid (.yaml) or a folder of one map"
                      : "name one of its maps: " + team_folders(path).front().string());
    return read_map_input(path / "map.mwdb", name);
  }
  const std::string ending = path.extension().string();
  if (ending == ".mwdb") {
    mapdb::StoredMaps stored = mapdb::read_store(path);
    MapInput input{std::move(stored.maps), {}, {path}, {}, std::move(stored.metadata)};
    if (input.maps.size() == 1) {
      const mapdb::StoreSummary store = mapdb::summarize_store(path);
      input.identity = identity_of(store.metadata, next_version({}, store.identity));
    }
    for (mapdb::MemberMap& member : stored.members) input.members.push_back(std::move(member.own));
    if (input.maps.empty())
      throw Error(ErrorCode::kBadInput, "there is no map in it", path.string(), "take a store that holds maps");
    return input;
  }
  if (ending == ".mwj") {
    MapInput input = journal_input(path);
    if (input.maps.empty())
      throw Error(ErrorCode::kBadInput, "there is no map in it: no client published anything to its server",
                  path.string(), "take a journal that holds maps");
    return input;
  }
  if (ending == ".yaml" || ending == ".yml") return grid_input(path, name);
  throw Error(ErrorCode::kBadInput,
              "is neither a map store (.mwdb) nor a server's journal (.mwj) nor a map_server grid (.yaml)",
              path.string(), "name one of these");
}

}  // namespace mapweave::runtime
