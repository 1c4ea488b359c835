#include "same_recording.h"

#include <algorithm>
#include <map>
#include <set>

namespace mapweave::fusion {
namespace {

constexpr double kMostShared = 0.8;             // of the smaller map's scans: more, and they are one recording
constexpr std::ptrdiff_t kFewestReadings = 20;  // with a return, of a scan that is like no other

// Of what was sensed; nullopt where that identifies nothing.
std::optional<Hash> print_of(const Payload& payload) {
  Hasher hasher;
  if (const auto* scan = std::get_if<PackedScan>(&payload)) {
    const auto seen =
        std::count_if(scan->ranges.begin(), scan->ranges.end(), [](std::uint16_t range) { return range != 0; });
    if (seen < kFewestReadings) return std::nullopt;
    for (const std::uint16_t range : scan->ranges) hasher.add(std::int64_t{range});
    return hasher.finish();
  }
  if (const auto* grid = std::get_if<OccupancyGrid>(&payload)) {
    const auto known = std::count_if(grid->log_odds.begin(), grid->log_odds.end(),
                                     [](std::int16_t cell) { return cell != OccupancyGrid::kUnknown; });
    if (known < kFewestReadings) return std::nullopt;
    for (const std::int16_t cell : grid->log_odds) hasher.add(std::int64_t{cell});
    return hasher.finish();
  }
  const auto& keyframe = std::get<KeyframeFeatures>(payload);
  if (static_cast<std::ptrdiff_t>(keyframe.points.size()) < kFewestReadings) return std::nullopt;
  for (const KeyframePoint& point : keyframe.points) hasher.add_bytes(&point, sizeof point);
  return hasher.finish();
}

std::set<Hash> prints_of(const Map& map) {
  std::set<Hash> prints;
  for (const auto& [id, node] : map.nodes) {
    if (node.payload == nullptr) continue;
    if (const auto print = print_of(*node.payload)) prints.insert(*print);
  }
  return prints;
}

}  // namespace

std::vector<std::optional<CopyOf>> copies_among(const std::vector<const Map*>& maps) {
  std::vector<std::set<Hash>> prints;
  std::map<Hash, std::vector<std::size_t>> holders;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    prints.push_back(prints_of(*maps[i]));
    for (const Hash& print : prints.back()) holders[print].push_back(i);
  }
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> common;
  for (const auto& [print, who] : holders)
    for (std::size_t i = 0; i < who.size(); ++i)
      for (std::size_t j = i + 1; j < who.size(); ++j) ++common[{who[i], who[j]}];
  std::vector<std::optional<CopyOf>> copies(maps.size());
  for (const auto& [pair, count] : common) {
    const auto [a, b] = pair;
    const std::size_t copy = prints[b].size() <= prints[a].size() ? b : a, original = copy == a ? b : a;
    const double share = static_cast<double>(count) / static_cast<double>(prints[copy].size());
    if (share > kMostShared && !copies[copy] && !copies[original]) copies[copy] = CopyOf{original, share};
  }
  return copies;
}

}  // namespace mapweave::fusion
