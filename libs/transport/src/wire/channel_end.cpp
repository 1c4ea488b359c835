#include "channel_end.h"

#include <algorithm>
#include <random>
#include <utility>

namespace mapweave::transport {
namespace {

ChannelReceiverOptions receiver_options(const ChannelEndOptions& options, std::uint64_t session) {
  return {!options.opens,   options.opens ? session : 0, options.priorities.size() + 1,
          options.received, options.missing_s,           3.0};
}

}  // namespace

std::uint64_t random_session() {
  std::random_device device;
  std::uint64_t number = 0;
  while (number == 0) number = std::uint64_t{device()} << 32 | device();
  return number;
}

ChannelEnd::ChannelEnd(ChannelEndOptions options, std::uint64_t number)
    : end_options(std::move(options)),
      incarnation(number),
      sender(end_options.sender),
      receiver(receiver_options(end_options, number)) {
  if (end_options.opens) sender.begin(incarnation);
  // Its bytes are no other's, so that the other end sees that this program was started again.
  sender.put({"", std::to_string(incarnation)}, 0, WireKind::opens);
}

Channel::Sent ChannelEnd::send(Envelope envelope) {
  const std::lock_guard lock(mutex);
  if (is_closed()) return Channel::Sent::never;
  const auto& all = end_options.priorities;
  const auto one = std::find_if(all.begin(), all.end(), [&](const std::vector<std::string>& subjects) {
    return std::find(subjects.begin(), subjects.end(), envelope.subject) != subjects.end();
  });
  const Channel::Sent sent = sender.put(std::move(envelope), static_cast<std::size_t>(one - all.begin()));
  if (sent == Channel::Sent::taken) stir();
  return sent;
}

std::size_t ChannelEnd::in_flight_bytes() {
  const std::lock_guard lock(mutex);
  return sender.bytes();
}

std::vector<Channel::Delivery> ChannelEnd::receive(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex);
  came.wait_for(lock, patience, [&] { return is_closed() || receiver.has_ready(); });
  return receiver.take();
}

void ChannelEnd::acknowledge(std::uint64_t delivery) {
  const std::lock_guard lock(mutex);
  receiver.acknowledge(delivery);
  stir();
}

void ChannelEnd::set_listener(std::function<void()> call) {
  {
    const std::lock_guard lock(mutex);
    listener = call;
  }
  if (call) call();
}

void ChannelEnd::close() {
  const std::lock_guard lock(mutex);
  if (std::exchange(closes, true)) return;
  linger_until_s = now_s() + end_options.linger_s;
  if (end_options.linger_s > 0.0 && !receiver.is_closed()) {
    sender.put({}, 0, WireKind::closes);
    receiver.close();
  }
  came.notify_all();
  stir();
}

void ChannelEnd::call_listener() {
  std::function<void()> call;
  {
    const std::lock_guard lock(mutex);
    call = listener;
  }
  if (call) call();
}

void ChannelEnd::take(std::size_t priority, std::string_view part, const std::string& reply) {
  bool is_news = false;
  {
    const std::lock_guard lock(mutex);
    const bool was_closed = receiver.is_closed();
    receiver.add(priority, part, reply, now_s());
    received_at_s = now_s();
    if (sender.session() == 0 && receiver.session() != 0) sender.begin(receiver.session());
    is_news = receiver.has_ready() || receiver.is_closed() != was_closed;
    if (is_news) came.notify_all();
    stir();
  }
  if (is_news) call_listener();
}

std::string ChannelEnd::end_of(std::uint64_t session) const {
  return WireMessage({"", std::to_string(incarnation)}, WireKind::closes, 0, session, kEndNumber, 4096).part(0);
}

Channel::Health ChannelEnd::health_now() const {
  Channel::Health health;
  for (std::size_t i = 0; i < kWireRefusals; ++i) health.refused += receiver.refused(static_cast<WireRefusal>(i));
  health.missed = receiver.counts().skipped;
  health.unconfirmed = unconfirmed_parts;
  if (const auto since = sender.full_since_s()) health.full_s = now_s() - *since;
  health.trouble = sender.trouble();
  return health;
}

}  // namespace mapweave::transport
