#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/runtime/live_camera.h>

namespace mapweave::runtime {

using Kind = ClientMessage::Kind;

LiveCamera::LiveCamera(visual::ClientPlace place, const visual::PinholeCamera& camera, double baseline_m, LiveCameraOptions options,
                       std::shared_ptr<LiveMapServer::Link> link)
    : place_(std::move(place)),
      link_(std::move(link)),
      agent_(place_, options.uplink),
      client_(camera, baseline_m, std::move(options.client), matching::shipped_vocabulary(),
              [this, period_s = 1.0 / options.share_rate_hz](visual::VisualClient& client, Stamp now, const visual::Tracked&) {
                if (last_ && seconds_between(*last_, now) < period_s) return;
                last_ = now;
                hear(client, std::chrono::milliseconds(0));
                exchange(client, now);
              }) {}

visual::VisualClient& LiveCamera::finish(std::chrono::milliseconds patience) {
  visual::VisualClient& client = client_.finish();
  const auto end = std::chrono::steady_clock::now() + patience;
  do {
    if (last_) exchange(client, *last_);
    hear(client, std::chrono::milliseconds(50));
  } while (agent_.waiting_bytes() > 0 && std::chrono::steady_clock::now() < end && !link_->is_closed());
  return client;
}

bool LiveCamera::send(Kind kind, std::string bytes) { return link_->send({kind, std::move(bytes)}) == LiveMapServer::Link::Sent::taken; }

void LiveCamera::exchange(visual::VisualClient& client, Stamp now) {
  const auto run = client.run(place_);
  if (!run) return;
  if (!greeted_) greeted_ = send(Kind::hello, encode(Hello{*run, matching::shipped_vocabulary().hash()}));
  if (!greeted_) return;
  bool is_taken = true;
  for (std::string& update : agent_.updates(client, now)) is_taken = is_taken && send(Kind::update, std::move(update));
  if (!is_taken) agent_.reconnected({});  // repeats next time
  if (auto view = agent_.view(client))
    send(Kind::view, std::move(*view));
  else if (auto request = agent_.place_request(client))
    send(Kind::place_request, std::move(*request));
}

void LiveCamera::hear(visual::VisualClient& client, std::chrono::milliseconds patience) {
  for (const ServerMessage& message : link_->take(patience)) try {
      switch (message.kind) {
        case ServerMessage::Kind::welcome: agent_.reconnected(message.receipts); break;
        case ServerMessage::Kind::receipts:
          for (const tiers::Receipt& receipt : message.receipts) agent_.stored(receipt);
          break;
        case ServerMessage::Kind::share: agent_.hear_share(client, message.bytes); break;
        case ServerMessage::Kind::place: agent_.hear_place(client, message.bytes); break;
        case ServerMessage::Kind::refused:
          if (refusal_ != message.bytes) log(LogLevel::warning, "the map server refuses: " + message.bytes);
          refusal_ = message.bytes;
      }
    } catch (const Error& error) {  // the client goes on without it
      log(LogLevel::warning, error.what());
    }
}

}  // namespace mapweave::runtime
