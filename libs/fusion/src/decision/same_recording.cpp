#include "same_recording.h"

#include <algorithm>
#include <map>
#include <set>

namespace mapweave::fusion {
namespace {

constexpr double kMostShared = 0.8;             // of the smaller map's scans: more, and they are one recording
constexpr std::size_t kFewestCommon = 5;        // scans of a thinned map: fewer are chance
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

// The scans that identify something, by their places among all nodes.
struct Prints {
  std::map<Hash, std::size_t> place;
  std::size_t nodes = 0;
  bool is_thinned = false;  // some nodes are without scans (thinning.h; a robot that stands still)
};

Prints prints_of(const Map& map) {
  Prints prints;
  for (const auto& [id, node] : map.nodes) {
    const std::size_t place = prints.nodes++;
    if (node.payload == nullptr)
      prints.is_thinned = true;
    else if (const auto print = print_of(*node.payload))
      prints.place.emplace(*print, place);
  }
  return prints;
}

// Of scans that two maps share.
struct Common {
  std::size_t count = 0, first = 0, last = 0;  // places in the copy
};

Common common_of(const Prints& copy, const Prints& original) {
  Common common;
  for (const auto& [print, place] : copy.place) {
    if (original.place.count(print) == 0) continue;
    common.first = common.count == 0 ? place : std::min(common.first, place);
    common.last = std::max(common.last, place);
    ++common.count;
  }
  return common;
}

// What a thinned map shares may have lost its scans on either side: then it shares all from the first common scan to
// the last one.
double share_of(const Common& common, const Prints& copy, const Prints& original) {
  const double of_scans = static_cast<double>(common.count) / static_cast<double>(copy.place.size());
  if (common.count < kFewestCommon || (!copy.is_thinned && !original.is_thinned)) return of_scans;
  return std::max(of_scans, static_cast<double>(common.last - common.first + 1) / static_cast<double>(copy.nodes));
}

}  // namespace

std::vector<std::optional<CopyOf>> copies_among(const std::vector<const Map*>& maps) {
  std::vector<Prints> prints;
  std::map<Hash, std::vector<std::size_t>> holders;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    prints.push_back(prints_of(*maps[i]));
    for (const auto& entry : prints.back().place) holders[entry.first].push_back(i);
  }
  std::set<std::pair<std::size_t, std::size_t>> sharing;
  for (const auto& [print, who] : holders)
    for (std::size_t i = 0; i < who.size(); ++i)
      for (std::size_t j = i + 1; j < who.size(); ++j) sharing.insert({who[i], who[j]});
  std::vector<std::optional<CopyOf>> copies(maps.size());
  for (const auto& [a, b] : sharing) {
    // Nodes, not scans: how many scans a map kept depends on what others show.
    const std::size_t copy = prints[b].nodes <= prints[a].nodes ? b : a, original = copy == a ? b : a;
    const double share = share_of(common_of(prints[copy], prints[original]), prints[copy], prints[original]);
    if (share > kMostShared && !copies[copy] && !copies[original]) copies[copy] = CopyOf{original, share};
  }
  return copies;
}

}  // namespace mapweave::fusion
