#include <mapweave/tiers/growing_map.h>

#include <mapweave/maps/map_update.h>

#include <algorithm>

namespace mapweave::tiers {
namespace {

bool is_empty(const MapUpdate& update) {
  return update.nodes.empty() && update.moved.empty() && update.submaps.empty() && update.constraints.empty() &&
         update.removed_nodes.empty() && update.removed_submaps.empty() && update.removed_constraints.empty();
}

bool is_same(const Payload& one, const Payload& other) {
  const auto *a = std::get_if<PackedScan>(&one), *b = std::get_if<PackedScan>(&other);
  if (a == nullptr || b == nullptr) return false;
  const ScanGeometry &of_a = *a->geometry, &of_b = *b->geometry;
  return a->ranges == b->ranges && of_a == of_b && a->motion == b->motion;
}

}  // namespace

Map growing_part(const Map& map) {
  Map part;
  part.id = map.id;
  part.nodes.reserve(map.nodes.size());
  for (const auto& [id, node] : map.nodes)
    if (node.payload != nullptr && std::holds_alternative<PackedScan>(*node.payload)) part.nodes.set(id, node);
  for (const auto& [id, submap] : map.submaps) {
    if (submap.submap_from_node.empty() || !part.nodes.contains(submap.anchor())) continue;
    Submap sent = submap;
    if (!sent.frozen) sent.submap_from_node.resize(1);
    part.submaps.set(id, std::move(sent));
  }
  for (const auto& [id, constraint] : map.constraints)
    if (id.kind == ConstraintKind::loop && part.nodes.contains(id.from) && part.nodes.contains(id.to))
      part.constraints.set(id, constraint);
  return part;
}

Map as_if_frozen(const Map& part, std::size_t least_scans) {
  Map whole = part;
  whole.submaps = {};
  bool is_filled = false;
  for (const auto& [id, submap] : part.submaps) {
    if (submap.frozen) {
      whole.submaps.set(id, submap);
      continue;
    }
    if (is_filled) continue;
    is_filled = true;
    const NodeId anchor = submap.anchor();
    const Pose3 submap_from_map = inverse(part.nodes.find(anchor)->map_from_node);
    Submap filled = submap;
    filled.submap_from_node.clear();
    for (const auto& [node_id, node] : part.nodes)
      if (node_id.session == anchor.session && !(node_id < anchor))
        filled.submap_from_node.emplace_back(
            node_id, node_id == anchor ? Pose3{} : compose(submap_from_map, node.map_from_node));
    if (filled.submap_from_node.size() < least_scans) continue;
    filled.frozen = true;
    filled.content = content_hash(filled, part.nodes);
    whole.submaps.set(id, std::move(filled));
  }
  return whole;
}

bool continues(const Map& older, const Map& newer) {
  if (older.id != newer.id) return false;
  for (const auto& [id, node] : older.nodes) {
    const Node* later = newer.nodes.find(id);
    if (later == nullptr || later->stamp != node.stamp) return false;
    if (later->payload != node.payload && !is_same(*later->payload, *node.payload)) return false;
  }
  for (const auto& [id, submap] : older.submaps) {
    const Submap* later = newer.submaps.find(id);
    if (later == nullptr) {
      if (submap.frozen) return false;
    } else if (later->anchor() != submap.anchor() || (submap.frozen && later->content != submap.content)) {
      return false;
    }
  }
  return true;
}

std::optional<std::string> GrowingMapSender::next(const Map& part) {
  const bool begins = sequence_ == 0 || !continues(sent_, part);
  MapUpdate update = difference(begins ? Map{} : sent_, part);
  if (is_empty(update)) return std::nullopt;
  update.origin = {from_, part.id};
  update.base = begins ? 0 : sequence_;
  update.sequence = ++sequence_;
  sent_ = part;
  return encode(update);
}

}  // namespace mapweave::tiers
