#pragma once
// A channel over a pipe that carries packets to the other end and may lose some, as topics of ROS do while they are
// connected: what the other end does not confirm is sent again.
//
// A packet is a part of a message (wire_envelope.h) with its class and token, or a note: which parts came, and up to
// which of them messages are acknowledged. The receiving end numbers the parts of a class as they come. Sessions are
// those of nats_channel.h. What comes is hostile.

#include <mapweave/transport/channel.h>
#include <mapweave/transport/in_process_channel.h>
#include <mapweave/transport/reassembly.h>

#include <memory>
#include <string_view>

namespace mapweave::transport {

struct DirectChannelOptions {
  std::string peer;    // for messages to the user
  bool opens = false;  // begins a session, as a robot does; else it belongs to the first that it sees
  // Subjects of envelopes by class, the most urgent first. All others are in one more class, the last.
  std::vector<std::vector<std::string>> priorities;
  ChannelLimits limits{std::size_t{16} << 20, 4096};
  ReassemblyLimits received;
  double confirm_s = 3.0;  // after which a part that nobody confirmed is sent again
  double linger_s = 0.5;   // as NatsChannelOptions
};

// All calls are thread-safe. One thread of its own.
class DirectChannel : public Channel {
 public:
  // send: a packet to the other end, or to nobody; called on the channel's thread, and not from its destructor on.
  DirectChannel(DirectChannelOptions options, std::function<void(std::string packet)> send);
  ~DirectChannel() override;  // as close(), and waits for it

  // What the other end sent, in any order and any number of times. Calls the listener.
  void take(std::string_view packet);

  Sent send(Envelope envelope) override;
  std::size_t in_flight_bytes() const override;
  std::vector<Delivery> receive(std::chrono::milliseconds patience) override;
  void acknowledge(std::uint64_t delivery) override;
  void set_listener(std::function<void()> listener) override;
  void close() override;
  bool is_closed() const override;
  std::optional<Measured> bytes_per_s() const override;
  Health health() const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::transport
