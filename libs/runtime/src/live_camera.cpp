#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/live_camera.h>

#include <utility>

namespace mapweave::runtime {

using Kind = ClientMessage::Kind;

LiveCamera::LiveCamera(visual::ClientPlace place, const Pinhole& camera, double baseline_m, LiveCameraOptions options,
                       std::shared_ptr<LiveMapServer::Link> link)
    : place_(std::move(place)),
      link_(std::move(link)),
      agent_(place_, options.uplink),
      vocabulary_(options.vocabulary.get().hash()),
      client_(camera, baseline_m, std::move(options.client), options.vocabulary.get(),
              [this, period_s = 1.0 / options.share_rate_hz](visual::VisualClient& client, Stamp now,
                                                             const visual::Tracked&) {
                if (last_ && seconds_between(*last_, now) < period_s) return;
                last_ = now;
                receive(client, std::chrono::milliseconds(0));
                publish(client, now);
                ask(client);
              }) {}

void LiveCamera::reconnect(std::shared_ptr<LiveMapServer::Link> link) {
  const std::lock_guard lock(mutex_);
  next_link_ = std::move(link);
}

visual::VisualClient& LiveCamera::finish(std::chrono::milliseconds patience) {
  visual::VisualClient& client = client_.finish();
  const auto end = std::chrono::steady_clock::now() + patience;
  agent_.lift_limit();
  bool more = client.run(place_).has_value();
  while (more && std::chrono::steady_clock::now() < end) {
    more = (last_ && publish(client, *last_)) || !welcome_ || agent_.waiting_bytes() > 0;
    if (link_->is_closed()) break;
    if (more) receive(client, std::chrono::milliseconds(50));
  }
  return client;
}

bool LiveCamera::send(Kind kind, std::string bytes) {
  const std::size_t size = bytes.size();
  const auto sent = link_->send({kind, std::move(bytes)});
  if (sent == LiveMapServer::Link::Sent::never && !link_->is_closed() && !std::exchange(reported_too_long_, true))
    refused(
        "a message of " + std::to_string(size) +
        " bytes is longer than the server's queue; give the server a larger queue_kb, or the camera fewer features");
  return sent == LiveMapServer::Link::Sent::taken;
}

void LiveCamera::refused(const std::string& why) {
  if (refusal_ != why) log(LogLevel::warning, "the map server refuses: " + why);
  refusal_ = why;
}

bool LiveCamera::publish(visual::VisualClient& client, Stamp now) {
  {
    const std::lock_guard lock(mutex_);
    if (next_link_) link_ = std::move(next_link_), next_link_.reset(), greeted_ = welcome_ = reported_too_long_ = false;
  }
  const auto run = client.run(place_);
  if (!run) return false;
  if (!greeted_) greeted_ = send(Kind::hello, encode(Hello{*run, vocabulary_}));
  if (!welcome_) return true;  // what the server has already is not published again
  bool is_taken = true;
  const std::vector<std::string> updates = agent_.updates(client, now);
  for (const std::string& update : updates) {
    is_taken = is_taken && send(Kind::update, update);
    if (!is_taken) agent_.put_back(update);
  }
  return !updates.empty();
}

void LiveCamera::ask(visual::VisualClient& client) {
  if (!welcome_) return;
  if (auto view = agent_.view(client))
    send(Kind::view, std::move(*view));
  else if (auto request = agent_.place_request(client))
    send(Kind::place_request, std::move(*request));
}

void LiveCamera::receive(visual::VisualClient& client, std::chrono::milliseconds patience) {
  for (const ServerMessage& message : link_->take(patience)) try {
      switch (message.kind) {
        case ServerMessage::Kind::welcome:
          agent_.reconnected(client, message.receipts);
          welcome_ = true;
          break;
        case ServerMessage::Kind::receipts:
          for (const tiers::Receipt& receipt : message.receipts) agent_.stored(receipt);
          break;
        case ServerMessage::Kind::share: agent_.receive_share(client, message.bytes); break;
        case ServerMessage::Kind::place: agent_.receive_place(client, message.bytes); break;
        case ServerMessage::Kind::refused: refused(message.bytes);
      }
    } catch (const Error& error) {  // the client goes on without it
      log(LogLevel::warning, error.what());
    }
}

}  // namespace mapweave::runtime
