#include <mapweave/core/error.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/fusion/raster_doubt.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/mapdb/update_journal.h>
#include <mapweave/runtime/map_input.h>
#include <mapweave/tiers/visual_server.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

// What a server that goes on from there would have of its clients.
std::vector<Map> maps_of_journal(const std::filesystem::path& path) {
  mapdb::UpdateJournal journal = mapdb::UpdateJournal::left_behind(path);
  tiers::VisualServer server(TierId("journal"), {}, {});
  journal.replay([&](const mapdb::JournalEntry& entry) {
    if (entry.vetoed) return;
    try {
      server.greet({entry.from, server.vocabulary()});
      server.receive(entry.from, entry.update);
    } catch (const Error& error) {
      throw Error(ErrorCode::kCorrupt, std::string("an update of it does not fit: ") + error.what(), path.string(),
                  "take an undamaged copy of the journal");
    }
  });
  return server.maps();
}

MapInput grid_input(const std::filesystem::path& path, const MapId& name) {
  const OccupancyGrid grid = exporters::read_map_server(path);
  if (std::all_of(grid.log_odds.begin(), grid.log_odds.end(),
                  [](std::int16_t cell) { return cell == OccupancyGrid::kUnknown; }))
    throw Error(ErrorCode::kBadInput, "every cell of the grid is unknown", path.string(),
                "check its image and its thresholds");
  MapInput input{{fusion::map_of_grid(name, grid)}, {}, {path, exporters::image_of_map_server(path)}, {}};
  if (const std::string doubt = fusion::doubt_of_raster(grid); !doubt.empty())
    input.notes = {path.string() + " " + doubt + ": check its image and its thresholds"};
  return input;
}

}  // namespace

MapInput read_map_input(const std::filesystem::path& path, MapId name) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored))
    throw Error(ErrorCode::kMissing, "is not there", path.string(), "check the path");
  if (std::filesystem::is_directory(path, ignored)) {
    if (!std::filesystem::exists(path / "map.mwdb", ignored))
      throw Error(ErrorCode::kBadInput, "is a folder without a map.mwdb", path.string(),
                  "name a map (.mwdb), a journal (.mwj), a map_server grid (.yaml) or a folder of one map");
    return read_map_input(path / "map.mwdb", name);
  }
  const std::string ending = path.extension().string();
  if (ending == ".mwdb") {
    mapdb::StoredMaps stored = mapdb::read_store(path);
    MapInput input{std::move(stored.maps), {}, {path}, {}, std::move(stored.metadata)};
    for (mapdb::MemberMap& member : stored.members) input.members.push_back(std::move(member.own));
    if (input.maps.empty())
      throw Error(ErrorCode::kBadInput, "there is no map in it", path.string(), "take a store that holds maps");
    return input;
  }
  if (ending == ".mwj") {
    MapInput input{maps_of_journal(path), {}, mapdb::UpdateJournal::files_of(path), {}};
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
