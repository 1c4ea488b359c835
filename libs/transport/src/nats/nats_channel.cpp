#include "nats_channel_state.h"

#include <mapweave/core/error.h>

#include <numeric>
#include <random>

namespace mapweave::transport {

using std::chrono::milliseconds;

namespace {

std::uint64_t random_number() {
  std::random_device device;
  std::uint64_t number = 0;
  while (number == 0) number = std::uint64_t{device()} << 32 | device();
  return number;
}

}  // namespace

NatsChannel::NatsChannel(std::shared_ptr<NatsConnection> connection, NatsChannelOptions options)
    : state_(std::make_shared<State>(std::move(connection), std::move(options), random_number())) {
  state_->open();
  state_->thread = std::thread([state = state_] { state->run(); });
}

NatsChannel::~NatsChannel() {
  set_listener(nullptr);
  close();
  {
    const std::lock_guard lock(state_->mutex);
    state_->ends = true;
    state_->stir();
  }
  // A listener may let go of its channel: the connection's thread, which it is called on, must not wait for one that
  // may wait for it.
  if (state_->connection->is_own_thread())
    state_->thread.detach();
  else
    state_->thread.join();
}

Channel::Sent NatsChannel::send(Envelope envelope) {
  const std::lock_guard lock(state_->mutex);
  if (state_->is_closed()) return Sent::never;
  const std::size_t priority = state_->priority_of(envelope.subject);
  const Sent sent = state_->sender.put(std::move(envelope), priority);
  if (sent == Sent::taken) state_->stir();
  return sent;
}

std::size_t NatsChannel::in_flight_bytes() const {
  const std::lock_guard lock(state_->mutex);
  return state_->sender.bytes();
}

std::vector<Channel::Delivery> NatsChannel::receive(milliseconds patience) {
  std::unique_lock lock(state_->mutex);
  state_->came.wait_for(lock, patience, [&] { return state_->is_closed() || state_->receiver.has_ready(); });
  return state_->receiver.take();
}

void NatsChannel::acknowledge(std::uint64_t delivery) {
  const std::lock_guard lock(state_->mutex);
  state_->receiver.acknowledge(delivery);
  state_->stir();
}

void NatsChannel::set_listener(std::function<void()> listener) {
  {
    const std::lock_guard lock(state_->mutex);
    state_->listener = listener;
  }
  if (listener) listener();
}

void NatsChannel::close() {
  const std::lock_guard lock(state_->mutex);
  if (std::exchange(state_->closes, true)) return;
  state_->linger_until_s = state_->now_s() + state_->options.linger_s;
  if (state_->options.linger_s > 0.0 && !state_->receiver.is_closed()) {
    state_->sender.put({}, 0, WireKind::closes);
    state_->receiver.close();
  }
  state_->came.notify_all();
  state_->stir();
}

bool NatsChannel::is_closed() const {
  const std::lock_guard lock(state_->mutex);
  return state_->is_closed();
}

NatsChannelState NatsChannel::state() const {
  const std::lock_guard lock(state_->mutex);
  const double now_s = state_->now_s();
  NatsChannelState shown = state_->shown;
  shown.is_open = state_->receiver.session() != 0 && state_->received_at_s.has_value() && !state_->is_closed();
  shown.in_flight_bytes = state_->sender.bytes();
  if (const auto since = state_->sender.full_since_s()) shown.full_s = now_s - *since;
  if (state_->received_at_s) shown.received_s = now_s - *state_->received_at_s;
  shown.received = state_->receiver.counts();
  for (std::size_t i = 0; i < kWireRefusals; ++i)
    shown.refused[i] = state_->receiver.refused(static_cast<WireRefusal>(i));
  if (const std::string& of_sender = state_->sender.trouble(); !of_sender.empty())
    shown.trouble = of_sender + (shown.trouble.empty() ? "" : "; " + shown.trouble);
  return shown;
}

Channel::Health NatsChannel::health() const {
  const NatsChannelState now = state();
  return {std::accumulate(now.refused.begin(), now.refused.end(), std::uint64_t{0}), now.received.skipped,
          now.unconfirmed_parts, now.full_s, now.trouble};
}

std::optional<Channel::Measured> NatsChannel::bytes_per_s() const {
  const std::lock_guard lock(state_->mutex);
  const auto measured =
      state_->options.link_end == LinkEnd::broker ? state_->sender.to_broker() : state_->sender.to_receiver();
  if (!measured) return std::nullopt;
  return Measured{measured->bytes_per_s, state_->now_s() - measured->at_s};
}

}  // namespace mapweave::transport
