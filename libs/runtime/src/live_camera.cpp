#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/live_camera.h>
#include <mapweave/tiers/subjects.h>

#include <utility>

namespace mapweave::runtime {

namespace subject = tiers::subject;
namespace {

constexpr char kServer[] = "the map server";

}  // namespace

LiveCamera::LiveCamera(visual::ClientPlace place, const Pinhole& camera, double baseline_m, LiveCameraOptions options,
                       std::shared_ptr<transport::Channel> channel)
    : place_(std::move(place)),
      channel_(std::move(channel)),
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

void LiveCamera::reconnect(std::shared_ptr<transport::Channel> channel) {
  const std::lock_guard lock(mutex_);
  next_channel_ = std::move(channel);
}

visual::VisualClient& LiveCamera::finish(std::chrono::milliseconds patience) {
  visual::VisualClient& client = client_.finish();
  const auto end = std::chrono::steady_clock::now() + patience;
  agent_.lift_limit();
  bool more = client.run(place_).has_value();
  while (more && std::chrono::steady_clock::now() < end) {
    more = (last_ && publish(client, *last_)) || !welcome_ || agent_.waiting_bytes() > 0;
    if (channel_->is_closed()) break;
    if (more) receive(client, std::chrono::milliseconds(50));
  }
  return client;
}

bool LiveCamera::send(transport::Envelope message) {
  const std::size_t size = message.bytes.size();
  const auto sent = channel_->send(std::move(message));
  if (sent == transport::Channel::Sent::never && !channel_->is_closed() && !std::exchange(reported_too_long_, true))
    refused(
        "a message of " + std::to_string(size) +
        " bytes is longer than the server's queue; give the server a larger queue_kb, or the camera fewer features");
  return sent == transport::Channel::Sent::taken;
}

void LiveCamera::refused(const std::string& why) {
  if (refusal_ != why) log(LogLevel::warning, "the map server refuses: " + why);
  refusal_ = why;
}

void LiveCamera::note_lost(std::size_t forgotten) {
  if (forgotten == 0) return;
  log(LogLevel::warning,
      "camera " + place_.client.robot.str() + "." + place_.client.sensor.str() +
          ": the map server lacks what the one before had; the camera publishes its map again, but " +
          std::to_string(forgotten) +
          " keyframes that it had no room for (visual.memory.keyframes) were on that server alone; "
          "begin the map server with that one's journal, or give the camera more room");
}

bool LiveCamera::publish(visual::VisualClient& client, Stamp now) {
  {
    const std::lock_guard lock(mutex_);
    if (next_channel_) {
      channel_ = std::move(next_channel_);
      next_channel_.reset();
      greeted_ = welcome_ = reported_too_long_ = false;
    }
  }
  const auto run = client.run(place_);
  if (!run) return false;
  if (!greeted_) greeted_ = send({subject::kHello, encode(Hello{*run, vocabulary_})});
  if (!welcome_) return true;  // what the server has already is not published again
  bool is_taken = true;
  const std::vector<transport::Envelope> updates = agent_.updates(client, now);
  for (const transport::Envelope& update : updates) {
    is_taken = is_taken && send(update);
    if (!is_taken) agent_.put_back(update);
  }
  return !updates.empty();
}

void LiveCamera::ask(visual::VisualClient& client) {
  if (!welcome_) return;
  if (auto view = agent_.view(client))
    send({subject::kView, std::move(*view)});
  else if (auto request = agent_.place_request(client))
    send({subject::kPlaceRequest, std::move(*request)});
}

void LiveCamera::receive(visual::VisualClient& client, std::chrono::milliseconds patience) {
  for (const transport::Channel::Delivery& delivery : channel_->receive(patience)) {
    const std::string &subject = delivery.envelope.subject, &bytes = delivery.envelope.bytes;
    try {
      if (subject == subject::kWelcome) {
        note_lost(agent_.reconnected(client, decode_receipts(bytes, kServer)));
        welcome_ = true;
      } else if (subject == subject::kReceipts) {
        for (const Receipt& receipt : decode_receipts(bytes, kServer)) agent_.stored(receipt);
      } else if (subject == subject::kShare) {
        agent_.receive_share(client, bytes);
      } else if (subject == subject::kPlace) {
        agent_.receive_place(client, bytes);
      } else if (subject == subject::kRefusal) {
        refused(decode_refusal(bytes, kServer).why.what());
      }
    } catch (const Error& error) {  // the client goes on without it
      log(LogLevel::warning, error.what());
    }
    channel_->acknowledge(delivery.number);
  }
}

}  // namespace mapweave::runtime
