#include "update_parts.h"

#include <mapweave/tiers/camera_agent.h>
#include <mapweave/tiers/subjects.h>

#include <algorithm>
#include <set>
#include <utility>

namespace mapweave::tiers {
namespace {

constexpr std::size_t kMostWaiting = std::size_t{1} << 20;  // bytes in memory
constexpr std::size_t kMostUpdate = std::size_t{48} << 10;  // bytes: a live server's queue may be as short as 64 KB

// `count` features, evenly picked, so that they stay spread over the picture and its pyramid.
std::shared_ptr<const Payload> thinned(const KeyframeFeatures& whole, std::size_t count) {
  KeyframeFeatures few{whole.geometry, {}, {}};
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t from = i * whole.points.size() / count;
    few.points.push_back(whole.points[from]);
    few.descriptors.push_back(whole.descriptors[from]);
  }
  return std::make_shared<const Payload>(std::move(few));
}

}  // namespace

CameraAgent::CameraAgent(visual::ClientPlace place, UplinkOptions options, std::unique_ptr<transport::Outbox> outbox)
    : place_(std::move(place)),
      options_(options),
      outbox_(outbox ? std::move(outbox) : std::make_unique<transport::MemoryOutbox>(kMostWaiting)) {}

std::string CameraAgent::counted(std::string bytes) {
  count(bytes);
  return bytes;
}

void CameraAgent::count(const std::string& bytes) {
  sent_bytes_ += bytes.size();
  allowance_.spend(bytes.size());
}

MapUpdate CameraAgent::fitted(MapUpdate update, double room_bytes) const {
  if (options_.most_bytes_per_s == 0.0) return update;
  const std::string bytes = encode(update);
  if (static_cast<double>(bytes.size()) <= room_bytes) return update;
  std::size_t features = 0;
  for (const Node& node : update.nodes)
    if (const KeyframeFeatures* keyframe = keyframe_of(node)) features += keyframe->points.size();
  if (features == 0) return update;
  const double others = static_cast<double>(bytes.size()) - kFeatureBytes * static_cast<double>(features);
  const double share = std::clamp((room_bytes - others) / (kFeatureBytes * static_cast<double>(features)), 0.0, 1.0);
  for (Node& node : update.nodes) {
    const KeyframeFeatures* keyframe = keyframe_of(node);
    if (keyframe == nullptr) continue;
    const std::size_t all = keyframe->points.size();
    const auto kept = std::max(static_cast<std::size_t>(share * static_cast<double>(all)),
                               static_cast<std::size_t>(options_.least_features));
    if (kept < all) node.payload = thinned(*keyframe, kept);
  }
  return update;
}

void CameraAgent::enqueue(MapUpdate update) {
  const MapId map = update.origin.map;
  std::uint64_t& published = numbers_[map].published;
  update.base = update.base == 0 ? 0 : published;
  update.sequence = published + 1;
  for (std::string& bytes : encoded_in_parts(fitted(std::move(update), allowance_.bytes()), kMostUpdate))
    outbox_->append({subject::kUpdate, std::move(bytes), map.str(), ++published});
}

std::vector<transport::Envelope> CameraAgent::updates(visual::VisualClient& client, Stamp now) {
  const double bytes_per_s = options_.most_bytes_per_s;
  if (bytes_per_s > 0.0) allowance_.wait_until(now, bytes_per_s);
  const bool may_send = bytes_per_s == 0.0 || allowance_.bytes() > 0.0;
  if (may_send && outbox_->has_room()) {
    session_ = client.run(place_);
    for (MapUpdate& update : client.take_updates(place_, visual::PublishedDetail::light)) enqueue(std::move(update));
  }
  std::vector<transport::Envelope> due = outbox_->take_due();
  for (const transport::Envelope& update : due) count(update.bytes);
  return due;
}

void CameraAgent::put_back(const transport::Envelope& update) {
  outbox_->repeat(update.sender, update.sequence);
  sent_bytes_ -= update.bytes.size();
  allowance_.give_back(update.bytes.size());
}

void CameraAgent::stored(const Receipt& receipt) {
  outbox_->forget(receipt.origin.map.str(), receipt.stored);
  if (const auto known = numbers_.find(receipt.origin.map); known != numbers_.end())
    known->second.confirmed = std::max(known->second.confirmed, receipt.stored);
  if (receipt.awaited > 0) outbox_->repeat(receipt.origin.map.str(), receipt.awaited);
}

std::size_t CameraAgent::reconnected(visual::VisualClient& client, const std::vector<Receipt>& receipts) {
  outbox_->repeat_all();
  std::set<MapId> lacking;
  std::map<MapId, std::uint64_t> stored_of;
  for (const Receipt& receipt : receipts)
    if (visual::session_of(place_.client, receipt.origin.map)) stored_of[receipt.origin.map] = receipt.stored;
  for (const auto& [map, stored] : stored_of) numbers_.try_emplace(map);
  for (auto& [map, numbers] : numbers_) {
    const std::uint64_t stored = stored_of[map];
    if (stored < numbers.confirmed || stored > numbers.published) {
      outbox_->forget(map.str(), numbers.published);
      client.publish_again(place_, map);
      lacking.insert(map);
      numbers.published = std::max(numbers.published, stored);
    }
    numbers.confirmed = stored;
  }
  for (const Receipt& receipt : receipts) stored(receipt);
  if (lacking.empty()) return 0;
  const auto forgotten = client.forgotten_keyframes(place_);
  return static_cast<std::size_t>(
      std::count_if(forgotten.begin(), forgotten.end(), [&](const auto& one) { return lacking.count(one.map) != 0; }));
}

std::optional<std::string> CameraAgent::view(const visual::VisualClient& client) {
  auto here = client.view(place_);
  if (!here) return std::nullopt;
  if (const auto known = numbers_.find(here->map); known != numbers_.end()) {
    Numbers& numbers = known->second;
    if (std::exchange(numbers.missed_by_client, here->missed) != here->missed) {
      ++numbers.missed;
      numbers.missed_after = 0;  // of whatever share
    }
    here->missed = numbers.missed;
    here->missed_after = numbers.missed_after;
  }
  return counted(encode(*here));
}

std::optional<std::string> CameraAgent::place_request(visual::VisualClient& client) {
  const auto request = client.place_request(place_);
  if (request) session_ = client.run(place_);
  return request ? std::optional(counted(encode(*request))) : std::nullopt;
}

// Numbers that leave one out show that shares were lost; those of a server that knows nothing yet begin at 1 again.
bool CameraAgent::is_repeated(const Share& share) {
  const auto known = numbers_.find(share.map);
  if (share.number == 0 || known == numbers_.end()) return false;
  Numbers& numbers = known->second;
  const std::uint32_t before = std::exchange(numbers.share, share.number);
  if (share.number == 1 || share.number == before + 1) return false;
  if (share.number == before) return true;
  ++numbers.missed;
  numbers.missed_after = share.number < before ? 0 : before;
  return false;
}

void CameraAgent::receive_share(visual::VisualClient& client, std::string_view bytes) {
  received_bytes_ += bytes.size();
  const Share share = decode_share(bytes, "the camera map server");
  const auto session = visual::session_of(place_.client, share.map);
  if (!session || is_repeated(share)) return;
  if (!share.corrected.empty()) client.correct(place_, *session, share.corrected, share.scale);
  client.borrow(place_, *session, share.landmarks);
  if (!share.keyframes.empty() || !share.dropped.empty())
    client.keep_shared(place_, *session, share.keyframes, share.dropped);
}

visual::PlaceVerdict CameraAgent::receive_place(visual::VisualClient& client, std::string_view bytes) {
  received_bytes_ += bytes.size();
  return client.place(place_, decode_place_answer(bytes, "the camera map server"));
}

}  // namespace mapweave::tiers
