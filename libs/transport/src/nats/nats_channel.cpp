#include "nats_channel_state.h"

#include <mapweave/core/error.h>

namespace mapweave::transport {

NatsChannel::NatsChannel(std::shared_ptr<NatsConnection> connection, NatsChannelOptions options)
    : state_(std::make_shared<State>(std::move(connection), std::move(options), random_session())) {
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

Channel::Sent NatsChannel::send(Envelope envelope) { return state_->send(std::move(envelope)); }
std::size_t NatsChannel::in_flight_bytes() const { return state_->in_flight_bytes(); }
std::vector<Channel::Delivery> NatsChannel::receive(std::chrono::milliseconds patience) {
  return state_->receive(patience);
}
void NatsChannel::acknowledge(std::uint64_t delivery) { state_->acknowledge(delivery); }
void NatsChannel::set_listener(std::function<void()> listener) { state_->set_listener(std::move(listener)); }
void NatsChannel::close() { state_->close(); }

bool NatsChannel::is_closed() const {
  const std::lock_guard lock(state_->mutex);
  return state_->is_closed();
}

NatsChannelState NatsChannel::state() const {
  const std::lock_guard lock(state_->mutex);
  const double now_s = state_->now_s();
  NatsChannelState shown = state_->shown;
  shown.unconfirmed_parts = state_->unconfirmed_parts;
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
  Health health;
  {
    const std::lock_guard lock(state_->mutex);
    health = state_->health_now();
  }
  health.trouble = state().trouble;
  return health;
}

std::optional<Channel::Measured> NatsChannel::bytes_per_s() const {
  const std::lock_guard lock(state_->mutex);
  const auto measured =
      state_->options.link_end == LinkEnd::broker ? state_->sender.to_broker() : state_->sender.to_receiver();
  if (!measured) return std::nullopt;
  return Measured{measured->bytes_per_s, state_->now_s() - measured->at_s};
}

}  // namespace mapweave::transport
