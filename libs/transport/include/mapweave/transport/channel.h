#pragma once
// How messages get from one tier to another, whatever carries them: queues of one process (in_process_channel.h), or a
// network. Delivery is at least once: what a closed channel had in flight the sender sends again from its Outbox, and
// the receiver takes a message that it has already for nothing new, by its sender and number.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::transport {

struct Envelope {
  std::string subject;  // what it is, and so how it is read: "update"; a network's path goes before it
  std::string bytes;    // the message, encoded; nobody vouches for it
  // Of numbered messages: whose numbers they are, and from 1 on; 0: it is sent once, and missed where it is lost.
  std::string sender = {};
  std::uint64_t sequence = 0;
  bool last_counts = false;  // it takes the place of one of the same subject and sender that nobody has received yet
};

// One of a channel's two ends. All calls are thread-safe.
class Channel {
 public:
  virtual ~Channel() = default;

  // taken: it will be received, after those before it, unless the channel closes. later: too much is in flight.
  // never: it is too long, or the channel is closed. Never waits.
  enum class Sent { taken, later, never };
  virtual Sent send(Envelope envelope) = 0;
  // Bytes of what was sent and is not acknowledged.
  virtual std::size_t in_flight_bytes() const = 0;

  struct Delivery {
    Envelope envelope;
    std::uint64_t number = 0;  // for acknowledge()
  };
  // What has come, in order, as soon as there is something; empty when nothing came for so long, or the channel is
  // closed and nothing is left.
  virtual std::vector<Delivery> receive(std::chrono::milliseconds patience) = 0;
  // The receiver has done with it what it was for: what is to be kept is kept. Makes room for more.
  virtual void acknowledge(std::uint64_t delivery) = 0;
  // Called after something came or the other end closed, on whatever thread; once at the start.
  virtual void set_listener(std::function<void()> listener) = 0;

  struct Measured {
    double bytes_per_s = 0.0;
    double age_s = 0.0;  // since it was measured
  };
  // What the link carries from this end, measured while it was busy; nullopt: it was not yet, or nobody measures.
  virtual std::optional<Measured> bytes_per_s() const { return std::nullopt; }

  // What is wrong with the link, as far as this end knows, since the channel was made. Of a network.
  struct Health {
    std::uint64_t refused = 0;      // parts that came and belong to no message: damaged, foreign, too many
    std::uint64_t missed = 0;       // messages that never came
    std::uint64_t unconfirmed = 0;  // parts that were sent again, because nobody confirmed them in time
    std::optional<double> full_s;   // for so long there has been no room for what this end sends
    std::string trouble;            // what holds it up; empty: nothing known
  };
  virtual Health health() const { return {}; }

  virtual void close() = 0;
  virtual bool is_closed() const = 0;
};

}  // namespace mapweave::transport
