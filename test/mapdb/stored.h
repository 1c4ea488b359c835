#pragma once
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/mapdb/map_store.h>
#include <support/random_map.h>
#include <support/temporary_folder.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <set>

namespace mapweave::mapdb {

// Two robots' maps, the team's, what was judged of them.
inline StoredMaps some_maps(std::uint64_t seed = 1, std::uint32_t node_count = 30) {
  test::RandomMaps random(seed);
  StoredMaps stored;
  stored.maps = {random.map("alpha", node_count), random.map("beta", node_count / 2)};
  Map team;
  team.id = MapId("team");
  for (const Map& map : stored.maps)
    for (const auto& [id, node] : map.nodes) team.nodes.set(id, node);
  stored.maps.push_back(team);
  for (std::uint32_t i = 0; i < 5; ++i)
    stored.judgements.push_back(
        random.judgement({stored.maps[0].sessions().front(), i}, {stored.maps[1].sessions().front(), 0}));
  std::sort(stored.judgements.begin(), stored.judgements.end(),
            [](const auto& a, const auto& b) { return a.id < b.id; });
  stored.verdicts = {random.verdict(MapId("alpha"), MapId("beta"))};
  stored.metadata = {
      {"program", "mapweave 0.1.0"}, {"options", "laser:\n  engine: graph\n"}, {"place", "M\xc3\xa1laga"}};
  return stored;
}

// The error of a call, or nothing.
template <class Call>
std::optional<Error> error_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error;
  }
  return std::nullopt;
}

inline std::size_t count_files(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::directory_iterator(folder), std::filesystem::directory_iterator()));
}

}  // namespace mapweave::mapdb
