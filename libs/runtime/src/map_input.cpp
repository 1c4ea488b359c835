#include <mapweave/core/error.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/runtime/map_input.h>

namespace mapweave::runtime {

MapInput read_map_input(const std::filesystem::path& path, MapId name) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) throw Error(ErrorCode::kMissing, "is not there", path.string(), "check the path");
  if (std::filesystem::is_directory(path, ignored)) {
    if (!std::filesystem::exists(path / "map.mwdb", ignored))
      throw Error(ErrorCode::kBadInput, "is a folder without a map.mwdb", path.string(),
                  "name a map (.mwdb), a map_server grid (.yaml) or a folder of one map");
    return read_map_input(path / "map.mwdb", name);
  }
  const std::string ending = path.extension().string();
  if (ending == ".mwdb") {
    MapInput input{mapdb::read_store(path).maps, {path}};
    if (input.maps.empty()) throw Error(ErrorCode::kBadInput, "there is no map in it", path.string(), "take a store that holds maps");
    return input;
  }
  if (ending == ".yaml" || ending == ".yml")
    return {{fusion::map_of_grid(name, exporters::read_map_server(path))}, {path, exporters::image_of_map_server(path)}};
  throw Error(ErrorCode::kBadInput, "is neither a map store (.mwdb) nor a map_server grid (.yaml)", path.string(), "name one of these");
}

}  // namespace mapweave::runtime
