#pragma once
// One end of what two programs say to each other over channels that come and go: numbered both ways, kept until the
// other end's receipt, taken in order and once, whatever the channel loses, doubles or cuts. Not thread-safe.

#include <mapweave/core/stopwatch.h>
#include <mapweave/maps/exchange.h>
#include <mapweave/maps/receipt.h>
#include <mapweave/runtime/live_options.h>
#include <mapweave/transport/outbox.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

namespace mapweave::runtime {

using Clock = std::chrono::steady_clock;

using mapweave::seconds_since;
inline std::optional<double> seconds_since(const std::optional<Clock::time_point>& then) {
  return then ? std::optional(seconds_since(*then)) : std::nullopt;
}

struct Said {
  std::string subject, bytes;
  std::uint64_t number = 0;  // from 1
};

struct WireCounts {
  std::uint64_t sent = 0, sent_bytes = 0;     // messages, repetitions too
  std::uint64_t taken = 0, again = 0;         // in order; that had come before
  std::uint64_t refused = 0, unreadable = 0;  // the other end's hellos that were refused here; what cannot be decoded
};

// To those of a program with many wires.
template <class Counts>
void add_counts(const WireCounts& wire, Counts& counts) {
  counts.refused += wire.refused;
  counts.unreadable += wire.unreadable;
  counts.again += wire.again;
}

// Counts of channels before to those of the one now; how it is doing stays.
inline void add_counts(const transport::Channel::Health& before, transport::Channel::Health& wire) {
  wire.refused += before.refused;
  wire.missed += before.missed;
  wire.unconfirmed += before.unconfirmed;
}

// What its owner does. All are called within step().
struct WireHooks {
  // Who is there; how many of its numbers are stored here. Throws Error, which is sent to the other end.
  std::function<std::uint64_t(const Hello&)> greet;
  std::function<void(Said)> take;
  // The other end lacks what it had confirmed. begin_anew() and say all again.
  std::function<void()> lost = [] {};
};

class NumberedWire {
 public:
  // agreement: what both ends must have alike. peer: for messages, "edge north".
  NumberedWire(SessionId self, Hash agreement, std::string peer, const LiveWireOptions& options, WireHooks hooks);

  // In place of the one before.
  void use(std::shared_ptr<transport::Channel> channel);
  void close() {
    if (channel_ != nullptr) channel_->close();
  }
  bool is_open() const { return channel_ != nullptr && !channel_->is_closed(); }
  // It is there and takes what is said.
  bool is_welcome() const { return is_welcome_; }
  Clock::time_point received_at() const { return received_at_; }  // when it said something; at first when this began
  double silent_s(Clock::time_point now) const { return std::chrono::duration<double>(now - received_at_).count(); }
  // It says its receipts again and again: who has been silent for so long is not at the other end of this channel.
  bool is_dead(Clock::time_point now) const {
    return std::chrono::duration<double>(now - std::max(received_at_, opened_at_)).count() >=
           kSilences * options_.repeat_s;
  }
  const std::string& peer() const { return peer_; }
  const SessionId& self() const { return self_; }
  const std::optional<SessionId>& other() const { return other_; }
  const std::string& refusal() const { return refusal_; }  // the other end's last one

  // Gets the next number. What the other end has already is not sent.
  void append(std::string subject, std::string bytes);
  // What was said is forgotten; numbers begin again.
  void begin_anew(SessionId self);
  std::size_t waiting_bytes() const { return backlog_bytes_ + outbox_.bytes(); }
  std::uint64_t confirmed() const { return confirmed_; }  // by the other end
  bool is_all_confirmed() const { return confirmed_ >= appended_; }

  // What the other end said, up to this number, cannot be lost here any more.
  void store(std::uint64_t up_to);
  // Receives, unless `holds` (it comes later then), and sends what is due.
  void step(Clock::time_point now, bool holds);

  WireCounts counts() const { return counts_; }
  // What the link to the other end carried when it was measured last.
  const std::optional<double>& bytes_per_s() const { return bytes_per_s_; }
  // Of the channel that it uses now; what is counted, of those before it too.
  transport::Channel::Health health() const;

 private:
  static constexpr double kSilences = 5.0;
  void receive(transport::Envelope message, Clock::time_point now);
  void count_unreadable(const Error& error, bool is_numbered);
  void greet(const Hello& hello);
  void take_receipts(const std::vector<Receipt>& receipts, bool is_welcome, Clock::time_point now);
  void take(transport::Envelope message);
  void take_next(Said said);
  void take_waiting();
  void send_due(Clock::time_point now);
  bool send(transport::Envelope message);

  SessionId self_;
  Hash agreement_;
  std::string peer_;
  LiveWireOptions options_;
  WireHooks hooks_;
  std::shared_ptr<transport::Channel> channel_;
  transport::Channel::Health before_;  // counts of the channels before it
  Clock::time_point received_at_ = Clock::now(), opened_at_{}, greeted_{}, progress_{}, asked_again_{}, receipt_at_{};
  bool is_welcome_ = false, is_receipt_due_ = false, is_too_long_ = false;
  std::string refusal_;
  WireCounts counts_;
  std::optional<double> bytes_per_s_;

  // What is said: what there is room for is in the outbox, the rest behind it.
  transport::MemoryOutbox outbox_;
  std::deque<transport::Envelope> backlog_;
  std::size_t backlog_bytes_ = 0;
  std::uint64_t appended_ = 0, confirmed_ = 0;

  // What is received.
  std::optional<SessionId> other_;
  std::uint64_t taken_ = 0, stored_ = 0;
  std::map<std::uint64_t, Said> waiting_;  // for a number that is missing
  std::size_t waiting_received_bytes_ = 0;
};

}  // namespace mapweave::runtime
