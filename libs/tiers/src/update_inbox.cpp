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
        waiting_.try_emplace(sequence, Waiting{std::move(update), bytes}).second)
      waiting_bytes_ += bytes;
    return stored;
  }
  if (update.sequence <= stored_) return stored;
  store(update);
  stored.push_back(std::move(update));
  while (!waiting_.empty() && waiting_.begin()->first <= stored_ + 1) {
    Waiting next = std::move(waiting_.extract(waiting_.begin()).mapped());
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
  } else if (kept_->held.load(std::memory_order_acquire) == 0) {
    // Snapshots are taken here alone, so that 0 stays 0. To acquire it makes what others read before they let go of
    // theirs come before what is written now; the count of a shared_ptr promises no such order.
    apply(kept_->map, hanging_, update);
  } else {
    auto next = std::make_shared<Kept>();
    next->map = kept_->map;
    apply(next->map, hanging_, update);
    kept_ = std::move(next);
  }
  stored_ = update.sequence;
}

}  // namespace mapweave::tiers
