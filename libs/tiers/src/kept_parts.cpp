#include "owned_update.h"
#include "update_parts.h"

#include <mapweave/tiers/kept_map.h>

#include <algorithm>

namespace mapweave::tiers {
namespace {

bool is_seen_by(const Landmark& landmark, const std::set<NodeId>& nodes) {
  return std::any_of(landmark.seen.begin(), landmark.seen.end(),
                     [&](const LandmarkSighting& sighting) { return nodes.count(sighting.node) != 0; });
}

}  // namespace

std::vector<std::string> encoded_in_parts(const KeptMap& kept, std::size_t most_bytes) {
  MapUpdate all;
  all.origin.map = kept.map.id;
  all.sequence = 1;
  for (const auto& [id, node] : kept.map.nodes)
    if (kept.forgotten_nodes.count(id) != 0) all.nodes.push_back(node);
  for (const auto& [id, landmark] : kept.map.landmarks) {
    if (!is_seen_by(landmark, kept.forgotten_nodes)) continue;
    all.landmarks.push_back(landmark);
    if (kept.forgotten_landmarks.count(id) != 0) all.forgotten_landmarks.push_back(id);
  }
  if (all.nodes.empty()) return {};
  return encoded_in_parts(all, most_bytes);
}

KeptParts::KeptParts(SessionId client, const std::vector<visual::PlacedForgotten>& forgotten)
    : client_(std::move(client)) {
  for (const visual::PlacedForgotten& one : forgotten) forgotten_.insert(one.id);
}

void KeptParts::add(std::string_view bytes, const std::string& where) {
  MapUpdate part = decode_map_update(bytes, where);
  expect_own_map(part.origin.map, client_.client, where);
  expect_owned(part, client_, where);
  Receipt& came = came_[part.origin.map];
  came.origin = part.origin;
  if (part.sequence != came.stored + 1) return;
  came.stored = part.sequence;
  KeptMap& kept = maps_[part.origin.map];
  kept.map.id = part.origin.map;
  for (Node& node : part.nodes) {
    if (forgotten_.count(node.id) == 0) continue;
    kept.forgotten_nodes.insert(node.id);
    kept.map.nodes.set(node.id, std::move(node));
  }
  for (Landmark& landmark : part.landmarks)
    if (is_seen_by(landmark, forgotten_)) kept.map.landmarks.set(landmark.id, std::move(landmark));
  kept.forgotten_landmarks.insert(part.forgotten_landmarks.begin(), part.forgotten_landmarks.end());
}

std::vector<Receipt> KeptParts::receipts() const {
  std::vector<Receipt> receipts;
  for (const auto& [map, receipt] : came_) receipts.push_back(receipt);
  return receipts;
}

bool KeptParts::is_whole(const std::vector<Receipt>& of_server) const {
  return std::all_of(of_server.begin(), of_server.end(), [&](const Receipt& receipt) {
    const auto came = came_.find(receipt.origin.map);
    return came != came_.end() ? came->second.stored >= receipt.stored : receipt.stored == 0;
  });
}

std::vector<KeptMap> KeptParts::take() {
  std::vector<KeptMap> kept;
  for (auto& [id, map] : maps_) kept.push_back(std::move(map));
  maps_.clear();
  return kept;
}

}  // namespace mapweave::tiers
