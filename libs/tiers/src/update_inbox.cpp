#include <mapweave/core/error.h>
#include <mapweave/tiers/update_inbox.h>

#include <algorithm>

namespace mapweave::tiers {

UpdateInbox::UpdateInbox(Origin origin) : origin_(origin), kept_(std::make_shared<Kept>()) {
  kept_->map.id = origin.map;
}

std::vector<MapUpdate> UpdateInbox::receive(MapUpdate update, std::size_t bytes, const std::string& where,
                                            std::size_t most_waiting_bytes) {
  constexpr std::size_t kKeeping = 1024;  // bytes of an update that says nothing
  bytes += kKeeping;
  if (update.sequence == 0 || update.base >= update.sequence)
    throw Error(ErrorCode::kBadInput,
                "update " + std::to_string(update.sequence) + " says that it builds on update " +
                    std::to_string(update.base) + "; updates count from 1",
                where);
  std::vector<MapUpdate> stored;
  const bool says_all = update.base == 0;
  if (update.sequence > stored_ + 1 && !says_all) {
    const std::uint64_t sequence = update.sequence;
    if (waiting_.size() < kMostWaiting && waiting_bytes_ + bytes <= std::min(most_waiting_bytes, kMostWaitingBytes) &&
        waiting_.try_emplace(sequence, EarlyUpdate{std::move(update), bytes}).second)
      waiting_bytes_ += bytes;
    return stored;
  }
  if (update.sequence <= stored_) return stored;
  store(update);
  stored.push_back(std::move(update));
  while (!waiting_.empty() && waiting_.begin()->first <= stored_ + 1) {
    EarlyUpdate next = std::move(waiting_.extract(waiting_.begin()).mapped());
    waiting_bytes_ -= next.bytes;
    if (next.update.sequence <= stored_) continue;
    try {
      store(next.update);
    } catch (const Error&) {  // awaited again: its sender is informed then
      break;
    }
    stored.push_back(std::move(next.update));
  }
  return stored;
}

std::shared_ptr<const Map> UpdateInbox::snapshot() const {
  kept_->held.fetch_add(1, std::memory_order_relaxed);
  return {&kept_->map, [kept = kept_](const Map*) { kept->held.fetch_sub(1, std::memory_order_release); }};
}

// apply() throws before anything has changed.
void UpdateInbox::store(const MapUpdate& update) {
  if (update.base == 0) {
    auto all = std::make_shared<Kept>();
    LandmarksByNode hanging;
    apply(all->map, hanging, update);
    kept_ = std::move(all);
    hanging_ = std::move(hanging);
    forgotten_nodes_.clear();
    forgotten_landmarks_.clear();
    taken_out_.clear();
  } else if (concerns_forgotten(update)) {
    const MapUpdate here = fitted(update);
    apply_here(here);
    for (const LandmarkId& id : here.removed_landmarks) forgotten_landmarks_.erase(id);
    for (const MovedNode& moved : update.moved)
      if (const auto out = taken_out_.find(moved.id); out != taken_out_.end()) out->second = moved.map_from_node;
  } else {
    apply_here(update);
  }
  note_forgotten(update);
  stored_ = update.sequence;
}

void UpdateInbox::apply_here(const MapUpdate& update) {
  if (kept_->held.load(std::memory_order_acquire) == 0) {
    // Snapshots are taken here alone, so that 0 stays 0. To acquire it makes what others read before they let go of
    // theirs come before what is written now; the count of a shared_ptr promises no such order.
    apply(kept_->map, hanging_, update);
  } else {
    auto next = std::make_shared<Kept>();
    next->map = kept_->map;
    apply(next->map, hanging_, update);
    kept_ = std::move(next);
  }
}

bool UpdateInbox::concerns_forgotten(const MapUpdate& update) const {
  return !forgotten_nodes_.empty() || !forgotten_landmarks_.empty() || !taken_out_.empty() ||
         !update.forgotten_nodes.empty() || !update.forgotten_landmarks.empty();
}

// What it says of nodes that were taken out is left out; a landmark that is sent as a whole keeps what forgotten
// keyframes saw of it, which its sender knows no more; forgotten landmarks go with the keyframe that they hang on.
MapUpdate UpdateInbox::fitted(MapUpdate update) const {
  const auto is_out = [&](const NodeId& id) { return taken_out_.count(id) != 0; };
  const auto is_forgotten = [&](const NodeId& id) {
    return (forgotten_nodes_.count(id) != 0 ||
            std::binary_search(update.forgotten_nodes.begin(), update.forgotten_nodes.end(), id)) &&
           !std::binary_search(update.removed_nodes.begin(), update.removed_nodes.end(), id);
  };
  update.moved.erase(std::remove_if(update.moved.begin(), update.moved.end(),
                                    [&](const MovedNode& moved) { return is_out(moved.id); }),
                     update.moved.end());
  update.removed_nodes.erase(std::remove_if(update.removed_nodes.begin(), update.removed_nodes.end(), is_out),
                             update.removed_nodes.end());
  if (!taken_out_.empty()) {
    // What hung on them went with them.
    const auto is_here = [&](const LandmarkId& id) { return kept_->map.landmarks.contains(id); };
    update.removed_landmarks.erase(std::remove_if(update.removed_landmarks.begin(), update.removed_landmarks.end(),
                                                  [&](const LandmarkId& id) { return !is_here(id); }),
                                   update.removed_landmarks.end());
    update.changed_landmarks.erase(
        std::remove_if(update.changed_landmarks.begin(), update.changed_landmarks.end(),
                       [&](const LandmarkChange& change) {
                         return !is_here(change.id) &&
                                std::none_of(update.landmarks.begin(), update.landmarks.end(),
                                             [&](const Landmark& landmark) { return landmark.id == change.id; });
                       }),
        update.changed_landmarks.end());
  }
  const std::size_t named = update.removed_landmarks.size();
  for (const LandmarkId& id : hanging_on(update.removed_nodes))
    if (forgotten_landmarks_.count(id) != 0 ||
        std::binary_search(update.forgotten_landmarks.begin(), update.forgotten_landmarks.end(), id))
      update.removed_landmarks.push_back(id);
  std::inplace_merge(update.removed_landmarks.begin(),
                     update.removed_landmarks.begin() + static_cast<std::ptrdiff_t>(named),
                     update.removed_landmarks.end());
  update.removed_landmarks.erase(std::unique(update.removed_landmarks.begin(), update.removed_landmarks.end()),
                                 update.removed_landmarks.end());
  for (Landmark& landmark : update.landmarks) {
    const Landmark* before = kept_->map.landmarks.find(landmark.id);
    if (before == nullptr ||
        std::binary_search(update.removed_landmarks.begin(), update.removed_landmarks.end(), landmark.id))
      continue;
    for (const LandmarkSighting& sighting : before->seen) {
      if (!is_forgotten(sighting.node)) continue;
      const auto place =
          std::lower_bound(landmark.seen.begin(), landmark.seen.end(), sighting.node,
                           [](const LandmarkSighting& seen, const NodeId& node) { return seen.node < node; });
      if (place == landmark.seen.end() || sighting.node < place->node) landmark.seen.insert(place, sighting);
    }
  }
  return update;
}

void UpdateInbox::note_forgotten(const MapUpdate& update) {
  for (const NodeId& id : update.removed_nodes) {
    forgotten_nodes_.erase(id);
    taken_out_.erase(id);
  }
  for (const LandmarkId& id : update.removed_landmarks) forgotten_landmarks_.erase(id);
  for (const NodeId& id : update.forgotten_nodes)
    if (kept_->map.nodes.contains(id)) forgotten_nodes_.insert(id);
  for (const LandmarkId& id : update.forgotten_landmarks)
    if (kept_->map.landmarks.contains(id)) forgotten_landmarks_.insert(id);
}

std::set<LandmarkId> UpdateInbox::hanging_on(const std::vector<NodeId>& nodes) const {
  std::set<LandmarkId> result;
  for (const NodeId& id : nodes)
    for (const LandmarkId& hanging : hanging_.at(id))
      if (const Landmark* landmark = kept_->map.landmarks.find(hanging); landmark != nullptr && landmark->anchor == id)
        result.insert(hanging);
  return result;
}

MapUpdate UpdateInbox::content_of(const std::vector<NodeId>& nodes) const {
  const Map& map = kept_->map;
  MapUpdate content;
  content.origin = origin_;
  const std::set<LandmarkId> going = hanging_on(nodes);
  std::map<LandmarkId, LandmarkChange> staying;
  for (const NodeId& id : nodes) {
    MAPWEAVE_EXPECT(forgotten_nodes_.count(id) != 0, "its sender has forgotten " + to_string(id));
    content.nodes.push_back(*map.nodes.find(id));
    for (const LandmarkId& hanging : hanging_.at(id)) {
      const Landmark* landmark = map.landmarks.find(hanging);
      if (landmark == nullptr || going.count(hanging) != 0) continue;
      for (const LandmarkSighting& sighting : landmark->seen)
        if (sighting.node == id) {
          LandmarkChange& change = staying[hanging];
          change.id = hanging;
          change.seen.push_back(sighting);
        }
    }
  }
  for (const LandmarkId& id : going) content.landmarks.push_back(*map.landmarks.find(id));
  for (const auto& [id, change] : staying) content.changed_landmarks.push_back(change);
  return content;
}

void UpdateInbox::take_out(const std::vector<NodeId>& nodes) {
  const std::set<LandmarkId> going = hanging_on(nodes);
  MapUpdate removal;
  removal.origin = origin_;
  removal.removed_nodes = nodes;
  removal.removed_landmarks.assign(going.begin(), going.end());
  for (const NodeId& id : nodes) taken_out_[id] = kept_->map.nodes.find(id)->map_from_node;
  apply_here(removal);
  for (const NodeId& id : nodes) forgotten_nodes_.erase(id);
  for (const LandmarkId& id : going) forgotten_landmarks_.erase(id);
}

}  // namespace mapweave::tiers
