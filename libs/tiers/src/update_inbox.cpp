#include <mapweave/core/error.h>
#include <mapweave/tiers/update_inbox.h>

#include <algorithm>

namespace mapweave::tiers {

UpdateInbox::UpdateInbox(Origin origin) : origin_(origin) {
  Map map;
  map.id = origin.map;
  map_ = std::make_shared<const Map>(std::move(map));
}

std::vector<MapUpdate> UpdateInbox::receive(MapUpdate update, std::size_t bytes, const std::string& where, std::size_t most_waiting_bytes) {
  constexpr std::size_t kKeeping = 1024;  // bytes of an update that says nothing
  bytes += kKeeping;
  if (update.sequence == 0 || update.base >= update.sequence)
    throw Error(ErrorCode::kBadInput,
                "update " + std::to_string(update.sequence) + " says that it builds on update " + std::to_string(update.base) +
                    "; updates count from 1",
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
    } catch (const Error&) {  // awaited again: its sender hears of it then
      break;
    }
    stored.push_back(std::move(next.update));
  }
  return stored;
}

void UpdateInbox::store(const MapUpdate& update) {
  map_ = std::make_shared<const Map>(updated(update.base == 0 ? Map{} : *map_, update));  // throws before anything has changed
  stored_ = update.sequence;
}

}  // namespace mapweave::tiers
