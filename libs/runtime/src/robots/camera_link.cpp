#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/camera_link.h>
#include <mapweave/tiers/subjects.h>

#include <utility>

namespace mapweave::runtime {

namespace subject = tiers::subject;
namespace {

constexpr char kServer[] = "the camera map server";
constexpr double kSilences = 5.0;

}  // namespace

CameraLink::CameraLink(visual::ClientPlace place, CameraLinkOptions options,
                       std::shared_ptr<transport::Channel> channel)
    : place_(std::move(place)), options_(options), channel_(std::move(channel)), agent_(place_, options.uplink) {}

void CameraLink::use(std::shared_ptr<transport::Channel> channel) {
  std::shared_ptr<transport::Channel> past;
  const std::lock_guard lock(mutex_);
  past.swap(past_channel_);
  next_channel_.swap(channel);
}

bool CameraLink::is_cut() const {
  const std::lock_guard lock(mutex_);
  const auto& channel = next_channel_ ? next_channel_ : channel_;
  return channel == nullptr || channel->is_closed();
}

bool CameraLink::exchange(visual::VisualClient& client, Stamp now) {
  if (last_ && seconds_between(*last_, now) < 1.0 / options_.share_rate_hz) return false;
  last_ = now;
  receive(client, std::chrono::milliseconds(0));
  publish(client, now);
  ask(client);
  look_for_silence();
  return true;
}

bool CameraLink::publish_rest(visual::VisualClient& client, std::chrono::milliseconds patience) {
  agent_.lift_limit();
  if (!client.run(place_)) return false;
  const bool more = (last_ && publish(client, *last_)) || !welcome_ || agent_.waiting_bytes() > 0;
  if (more && !is_cut()) receive(client, patience);
  look_for_silence();
  return more;
}

bool CameraLink::fetch_kept(visual::VisualClient& client, std::chrono::milliseconds patience) {
  const auto run = client.run(place_);
  if (!run || has_all_kept_) return true;
  if (!welcome_) return false;
  const Clock::time_point now = Clock::now();
  if (!kept_) {
    kept_.emplace(*run, client.forgotten_keyframes(place_));
    asked_for_kept_at_ = {};
  }
  if (asked_for_kept_at_ == Clock::time_point{} ||
      (options_.repeat_s > 0.0 &&
       std::chrono::duration<double>(now - asked_for_kept_at_).count() >= options_.repeat_s)) {
    asked_for_kept_at_ = now;
    send({subject::kKeptRequest, encode(kept_->receipts())});
  }
  receive(client, patience);
  look_for_silence();
  return has_all_kept_ || is_kept_refused_;
}

std::vector<tiers::KeptMap> CameraLink::take_kept() {
  return has_all_kept_ ? kept_->take() : std::vector<tiers::KeptMap>{};
}

bool CameraLink::send(transport::Envelope message) {
  if (channel_ == nullptr) return false;
  const std::size_t size = message.bytes.size();
  const auto sent = channel_->send(std::move(message));
  if (sent == transport::Channel::Sent::never && !channel_->is_closed() && !std::exchange(reported_too_long_, true))
    refused(
        "a message of " + std::to_string(size) +
        " bytes is longer than the server's queue; give the server a larger queue_kb, or the camera fewer features");
  return sent == transport::Channel::Sent::taken;
}

void CameraLink::refused(const std::string& why) {
  if (refusal_ != why) log(LogLevel::warning, "the camera map server refuses: " + why);
  refusal_ = why;
}

void CameraLink::note_lost(std::size_t forgotten) {
  if (forgotten == 0) return;
  log(LogLevel::warning,
      "camera " + place_.client.robot.str() + "." + place_.client.sensor.str() +
          ": the camera map server lacks what the one before had; the camera publishes its map again, but " +
          std::to_string(forgotten) +
          " keyframes that it had no room for (visual.memory.keyframes) were on that server alone; "
          "begin the camera map server with that one's journal, or give the camera more room");
}

void CameraLink::take_next_channel() {
  const std::lock_guard lock(mutex_);
  if (!next_channel_) return;
  if (channel_) channel_->close();
  past_channel_ = std::exchange(channel_, std::exchange(next_channel_, nullptr));
  greeted_ = welcome_ = reported_too_long_ = false;
  kept_.reset();  // another server may cut it otherwise
  has_all_kept_ = is_kept_refused_ = false;
  answered_at_ = Clock::now();
}

bool CameraLink::publish(visual::VisualClient& client, Stamp now) {
  take_next_channel();
  const auto run = client.run(place_);
  if (!run) return false;
  if (!greeted_) greeted_ = send({subject::kHello, encode(Hello{*run, options_.vocabulary})});
  if (!welcome_) return true;  // what the server has already is not published again
  bool is_taken = true;
  const std::vector<transport::Envelope> updates = agent_.updates(client, now);
  for (const transport::Envelope& update : updates) {
    is_taken = is_taken && send(update);
    if (!is_taken) agent_.put_back(update);
  }
  return !updates.empty();
}

void CameraLink::ask(visual::VisualClient& client) {
  if (!welcome_) return;
  if (auto view = agent_.view(client))
    send({subject::kView, std::move(*view)});
  else if (auto request = agent_.place_request(client))
    send({subject::kPlaceRequest, std::move(*request)});
}

void CameraLink::receive(visual::VisualClient& client, std::chrono::milliseconds patience) {
  if (channel_ == nullptr) return;
  for (const transport::Channel::Delivery& delivery : channel_->receive(patience)) {
    answered_at_ = Clock::now();
    try {
      take(client, delivery.envelope);
    } catch (const Error& error) {  // the client goes on without it
      log(LogLevel::warning, error.what());
    }
    channel_->acknowledge(delivery.number);
  }
}

void CameraLink::take(visual::VisualClient& client, const transport::Envelope& message) {
  const std::string &subject = message.subject, &bytes = message.bytes;
  if (subject == subject::kWelcome) {
    note_lost(agent_.reconnected(client, decode_receipts(bytes, kServer)));
    welcome_ = true;
    refusal_.clear();
  } else if (subject == subject::kReceipts) {
    for (const Receipt& receipt : decode_receipts(bytes, kServer)) agent_.stored(receipt);
  } else if (subject == subject::kShare) {
    agent_.receive_share(client, bytes);
  } else if (subject == subject::kPlace) {
    agent_.receive_place(client, bytes);
  } else if (subject == subject::kKept && kept_) {
    kept_->add(bytes, kServer);
  } else if (subject == subject::kKeptEnd && kept_) {
    has_all_kept_ = kept_->is_whole(decode_receipts(bytes, kServer));
    asked_for_kept_at_ = {};
  } else if (subject == subject::kRefusal) {
    refused(decode_refusal(bytes, kServer).why.what());
    is_kept_refused_ = kept_.has_value();
  }
}

void CameraLink::look_for_silence() {
  const Clock::time_point now = Clock::now();
  const bool awaits = !is_cut() && (!welcome_ || agent_.waiting_bytes() > 0 || (kept_ && !has_all_kept_));
  if (!awaits) answered_at_ = now;
  if (options_.repeat_s > 0.0 && channel_ != nullptr &&
      std::chrono::duration<double>(now - answered_at_).count() >= kSilences * options_.repeat_s)
    channel_->close();
}

}  // namespace mapweave::runtime
