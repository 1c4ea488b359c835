#pragma once
// A channel whose ends are programs on different machines: parts of messages (wire_envelope.h) in a broker's streams,
// one per direction and priority class. It lives through lost connections, killed brokers and deleted streams.
//
//   one end --publishes--> stream "<out>_<class>", subject "mw.<out>.<class>.<peer>" --pulled by consumer "<peer>"-->
//   other end
//
// Delivery is as channel.h says, and each class is in order by itself. What one end sends is kept in its memory until
// the other has acknowledged it; what the programs themselves may not lose stands in an Outbox.
//
// Sessions: the end that opens (a robot, an edge) begins one with each channel that it makes; the end that accepts (an
// edge, the cloud) belongs to the first that it sees. Both are closed when one is, when the program of one is started
// again, and when the opening end makes another channel. Whose end was closed makes a new channel; what a session left
// in the streams is not delivered in the next one.

#include <mapweave/transport/channel.h>
#include <mapweave/transport/channel_receiver.h>
#include <mapweave/transport/channel_sender.h>
#include <mapweave/transport/nats_connection.h>

namespace mapweave::transport {

// Where a direction's streams are. Several peers share them.
struct NatsRoute {
  std::string streams;  // their names begin with it: letters, digits, '_', '-'
  std::string domain;   // of the broker that has them; empty: the connected one
  // Each stream refuses more. At least twice what all its peers may have in flight (`limits`), or parts of their long
  // messages may leave no room for each other.
  std::uint64_t stream_bytes = std::uint64_t{1} << 30;
};

enum class NatsChannelSide { opens, accepts };
// Whose confirmation says what the link carries. broker: it is behind the link (a robot and its edge's broker).
// receiver: the broker is on this side of it (an edge, whose stream the cloud reads).
enum class LinkEnd { broker, receiver };

struct NatsChannelOptions {
  std::string peer;  // names the channel among those that share streams: a robot, a client, an edge
  NatsChannelSide side = NatsChannelSide::opens;
  NatsRoute out, in;
  // Subjects of envelopes by class, the most urgent first. All others are in one more class, the last.
  std::vector<std::vector<std::string>> priorities;
  // Of what was sent and the other end has not acknowledged; never more than half of a stream.
  ChannelLimits limits{std::size_t{16} << 20, 4096};
  ReassemblyLimits received;
  std::size_t most_received_bytes = std::size_t{256} << 20;  // in memory; nothing more is asked for meanwhile
  double repeat_s = 5.0;  // what this end's program neither acknowledged nor still has is delivered again
  // So long a message that is missing holds up its class. Longer than a stream may have no room: its sender tries on.
  double missing_s = 60.0;
  // What close() and the destructor grant the rest on its path to the broker; 0: it ends as if it were killed, and the
  // other end is not informed.
  double linger_s = 0.5;
  LinkEnd link_end = LinkEnd::broker;
  // The accepting end makes the streams of both directions: the other end may make none, or comes much later.
  bool makes_streams = false;
};

// What an operator wants to know of one end.
struct NatsChannelState {
  bool is_open = false;     // both ends know of the session
  bool has_reader = false;  // the other end asks for messages, as the broker last said
  std::size_t in_flight_bytes = 0;
  std::optional<double> full_s;      // for so long a stream has had no room
  std::optional<double> received_s;  // since anything came from the other end
  ChannelReceiver::Counts received;
  std::array<std::uint64_t, kWireRefusals> refused{};
  std::uint64_t streams_made = 0, consumers_made = 0;  // the first ones included
  std::uint64_t sent_parts = 0, sent_bytes = 0;        // repetitions included
  std::uint64_t unconfirmed_parts = 0;                 // that the broker did not confirm in time: sent again
  std::string trouble;                                 // what holds it up; empty: nothing known
};

// All calls are thread-safe. One thread of its own; listeners are called on the connection's. The stream of a
// direction is made by the end that sends, the consumer by the one that receives, in any order.
class NatsChannel : public Channel {
 public:
  NatsChannel(std::shared_ptr<NatsConnection> connection, NatsChannelOptions options);
  ~NatsChannel() override;  // as close(), and waits for it unless a listener does it

  Sent send(Envelope envelope) override;
  std::size_t in_flight_bytes() const override;
  std::vector<Delivery> receive(std::chrono::milliseconds patience) override;
  void acknowledge(std::uint64_t delivery) override;
  void set_listener(std::function<void()> listener) override;
  void close() override;
  bool is_closed() const override;
  std::optional<Measured> bytes_per_s() const override;
  Health health() const override;

  NatsChannelState state() const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace mapweave::transport
