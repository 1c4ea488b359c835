#pragma once
// The sending half of a channel over a broker's streams: what waits, what is on its path, and what is done. Knows no
// network: who has one asks for the next part and reports what became of it.

#include <mapweave/transport/bandwidth.h>
#include <mapweave/transport/in_process_channel.h>
#include <mapweave/transport/nats_stream.h>
#include <mapweave/transport/wire_envelope.h>

#include <deque>
#include <map>
#include <memory>

namespace mapweave::transport {

struct ChannelSenderOptions {
  std::size_t priorities = 1;                         // classes; 0 goes first
  ChannelLimits limits;                               // of what is not acknowledged by the receiver
  std::size_t message_bytes = std::size_t{64} << 20;  // longest message
  double confirm_s = 10.0;                            // after which a part that nobody confirmed is sent again
};

// A message is kept until its receiver has acknowledged it, so that it survives a stream that was deleted. Not
// thread-safe. Times: as BandwidthMeter.
class ChannelSender {
 public:
  explicit ChannelSender(ChannelSenderOptions options);

  // Until there is a session nothing is sent. Contract: once.
  void begin(std::uint64_t session);
  std::uint64_t session() const { return session_; }

  // As Channel::send. Control messages (opens, closes) always have room.
  Channel::Sent put(Envelope envelope, std::size_t priority, WireKind kind = WireKind::message);

  struct MessagePart {
    std::uint64_t token = 0;  // names it
    std::size_t priority = 0;
    std::string bytes, message_id;
  };
  // The next part to publish: of the most urgent class that is not held up; nullopt: none now. No more than the link
  // carries in a second is on its path, so that what is urgent does not wait behind what is not.
  std::optional<MessagePart> next(double now_s);
  // It could not be handed over.
  void not_sent(std::uint64_t token);
  // What the broker says. Where its stream is full or gone, the class is held up for a while, then tried again.
  void published(std::uint64_t token, const Publication& publication, double now_s);
  // The connection was lost: what is not confirmed is sent again.
  void lost();
  // The stream was made anew: what is not acknowledged is sent again.
  void stream_lost(std::size_t priority);
  // The receiver has all up to this number of the stream.
  void acknowledged(std::size_t priority, std::uint64_t number, double now_s);
  // Parts that nobody confirmed in time are due again. Returns their count.
  std::size_t expire(double now_s);

  std::size_t bytes() const { return bytes_; }  // that are not acknowledged
  bool is_idle() const;                         // all is confirmed by the broker
  bool awaits(std::size_t priority) const { return !classes_.at(priority).messages.empty(); }
  bool has_no_stream(std::size_t priority) const { return classes_.at(priority).has_no_stream; }
  std::optional<double> full_since_s() const { return full_since_s_; }  // a stream that has no room
  const std::string& trouble() const { return trouble_; }               // why a part was not taken last; empty: it was
  // Of what the broker confirms, and of what the receiver acknowledges.
  std::optional<Bandwidth> to_broker() const { return to_broker_.estimate(); }
  std::optional<Bandwidth> to_receiver() const { return to_receiver_.estimate(); }

 private:
  enum class PartState : std::uint8_t { due, flying, stored };
  struct PartProgress {
    PartState state = PartState::due;
    std::uint64_t stored_as = 0, token = 0;
    double since_s = 0.0;
  };
  struct Outgoing {
    Envelope envelope;  // until it is begun
    WireKind kind = WireKind::message;
    std::unique_ptr<WireMessage> message;  // from then on
    std::vector<PartProgress> parts;
    std::size_t bytes = 0;
  };
  struct Class {
    std::deque<Outgoing> messages;
    std::uint64_t first = 1;      // number of the first of them
    std::uint64_t first_due = 1;  // before it nothing is due
    std::uint64_t last_stored = 0;
    double held_up_until_s = 0.0;
    bool has_no_stream = false;
  };
  struct Flying {
    std::size_t priority;
    std::uint64_t number;
    std::uint32_t part;
    std::size_t bytes;
  };
  void begin(Outgoing& message, std::size_t priority, std::uint64_t number) const;
  std::optional<MessagePart> next_of(std::size_t priority, double now_s);
  PartProgress* progress_of(const Flying& flying);
  std::size_t window() const;
  std::size_t part_bytes() const;

  ChannelSenderOptions options_;
  std::uint64_t session_ = 0, tokens_ = 0;
  std::vector<Class> classes_;
  std::map<std::uint64_t, Flying> flying_;  // by token
  std::size_t bytes_ = 0, messages_ = 0, flying_bytes_ = 0;
  std::optional<double> full_since_s_;
  std::string trouble_;
  BandwidthMeter to_broker_, to_receiver_;
};

}  // namespace mapweave::transport
