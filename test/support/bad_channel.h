#pragma once
// A channel that does what networks do: it loses messages, delivers them twice, and breaks. From one seed.

#include <mapweave/transport/channel.h>

#include <memory>
#include <mutex>
#include <random>

namespace mapweave::test {

struct Badness {
  double lost = 0.0, doubled = 0.0, cut = 0.0;  // share of the messages that are sent
  std::uint64_t seed = 1;
};

// Around one end; what the other end sends suffers alike when it is wrapped, too.
class BadChannel : public transport::Channel {
 public:
  BadChannel(std::shared_ptr<transport::Channel> channel, Badness badness)
      : channel_(std::move(channel)), badness_(badness), random_(badness.seed) {}

  Sent send(transport::Envelope envelope) override {
    const std::lock_guard lock(mutex_);
    const double fate = std::uniform_real_distribution<double>(0.0, 1.0)(random_);
    if (fate < badness_.cut) {
      channel_->close();
      return Sent::never;
    }
    if (fate < badness_.cut + badness_.lost) return channel_->is_closed() ? Sent::never : Sent::taken;
    if (fate < badness_.cut + badness_.lost + badness_.doubled) channel_->send(envelope);
    return channel_->send(std::move(envelope));
  }
  std::size_t in_flight_bytes() const override { return channel_->in_flight_bytes(); }
  std::vector<Delivery> receive(std::chrono::milliseconds patience) override { return channel_->receive(patience); }
  void acknowledge(std::uint64_t delivery) override { channel_->acknowledge(delivery); }
  void set_listener(std::function<void()> listener) override { channel_->set_listener(std::move(listener)); }
  std::optional<Measured> bytes_per_s() const override { return channel_->bytes_per_s(); }
  void close() override { channel_->close(); }
  bool is_closed() const override { return channel_->is_closed(); }

 private:
  const std::shared_ptr<transport::Channel> channel_;
  const Badness badness_;
  std::mutex mutex_;
  std::mt19937_64 random_;
};

}  // namespace mapweave::test
