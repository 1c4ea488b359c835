#include "client_wire.h"

#include <algorithm>

namespace mapweave::runtime {

void add(ClientCounts& sum, const ClientCounts& more) {
  sum.received_bytes += more.received_bytes, sum.sent_bytes += more.sent_bytes;
  sum.updates += more.updates, sum.views += more.views, sum.shares += more.shares, sum.places += more.places;
  sum.refused += more.refused, sum.put_off += more.put_off;
  sum.update_s += more.update_s, sum.retrieval_s += more.retrieval_s, sum.sending_s += more.sending_s,
      sum.place_s += more.place_s;
  sum.waited_s += more.waited_s;
  sum.longest_wait_s = std::max(sum.longest_wait_s, more.longest_wait_s);
  sum.longest_place_s = std::max(sum.longest_place_s, more.longest_place_s);
}

void LiveMapServer::Link::Wire::post(ServerMessage message) {
  const std::lock_guard lock(mutex_);
  if (message.kind == ServerMessage::Kind::receipts)
    for (const tiers::Receipt& receipt : message.receipts) receipts_[receipt.origin.map] = receipt;
  else if (message.kind == ServerMessage::Kind::refused)
    refusal_ = std::move(message.bytes);
  else
    answer_bytes_ += message.bytes.size(), answers_.push_back(std::move(message));
  changed_.notify_all();
}

bool LiveMapServer::Link::Wire::has_room(std::size_t most_bytes) {
  const std::lock_guard lock(mutex_);
  return answer_bytes_ < most_bytes;
}

void LiveMapServer::Link::Wire::end() {
  const std::lock_guard lock(mutex_);
  is_over_ = true;
  changed_.notify_all();
}

bool LiveMapServer::Link::Wire::is_over() {
  const std::lock_guard lock(mutex_);
  return is_over_;
}

std::vector<ServerMessage> LiveMapServer::Link::Wire::take(std::chrono::milliseconds patience) {
  std::vector<ServerMessage> taken;
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, patience,
                    [&] { return is_over_ || !answers_.empty() || !receipts_.empty() || !refusal_.empty(); });
  if (!receipts_.empty()) {
    ServerMessage receipts;
    for (const auto& [map, receipt] : receipts_) receipts.receipts.push_back(receipt);
    taken.push_back(std::move(receipts));
  }
  for (ServerMessage& answer : answers_) taken.push_back(std::move(answer));
  if (!refusal_.empty()) taken.push_back({ServerMessage::Kind::refused, std::move(refusal_), {}});
  answers_.clear(), answer_bytes_ = 0, receipts_.clear(), refusal_.clear();
  return taken;
}

}  // namespace mapweave::runtime
