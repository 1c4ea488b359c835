#pragma once
// What the thread of a channel's end does: parts to the broker, parts from it, and what both say of each other.

#include "wire/channel_end.h"

#include <mapweave/transport/nats_channel.h>
#include <mapweave/transport/nats_stream.h>

#include <thread>

namespace mapweave::transport {

struct NatsChannel::State : ChannelEnd, std::enable_shared_from_this<State> {
  State(std::shared_ptr<NatsConnection> made, NatsChannelOptions given, std::uint64_t number);
  // Inboxes; before the thread begins.
  void open();
  void run();

  // One direction of one class.
  struct Outgoing {
    NatsStream stream;
    NatsConsumer readers;  // the other end's, only to ask of
    bool is_sure = false;  // the stream is there
    double asked_s = -1e9, ask_every_s = 0.0;
    std::uint64_t acknowledged = 0;
    std::string reader_created{};  // as ConsumerState has it
  };
  struct Incoming {
    NatsConsumer consumer;
    NatsStream stream;  // only to take away what was acknowledged
    std::unique_ptr<NatsInbox> inbox;
    bool is_sure = false, was_sure = false, is_to_restart = true;
    int asked_for = 0;  // messages that the broker may still deliver
    double asked_until_s = 0.0, delivered_s = 0.0, purged_s = 0.0;
    bool asks_why_silent = false;  // a request brought nothing
    int times_silent = 0;          // in a row, although there are messages
    bool has_new_acknowledged = false;
    std::uint64_t purged = 0;             // up to there
    std::uint64_t bytes_since_purge = 0;  // delivered
  };

  const std::shared_ptr<NatsConnection> connection;
  const NatsChannelOptions options;
  std::unique_ptr<NatsInbox> answers;
  std::vector<Outgoing> out;
  std::vector<Incoming> in;
  std::thread thread;

  NatsChannelState shown;

 private:
  // On the connection's thread.
  void on_answer(const NatsMessage& message);
  void on_delivery(std::size_t priority, const NatsMessage& message);
  void on_state_out(std::size_t priority, const std::optional<ConsumerState>& state);
  void on_state_in(std::size_t priority, const std::optional<ConsumerState>& state);
  void found_gone();  // under the lock: a stream or consumer

  // On its own thread.
  void ensure();
  bool try_to(const std::function<void()>& work);
  void ensure_streams(const std::vector<std::size_t>& priorities);
  void ensure_consumers(const std::vector<std::size_t>& priorities);
  double wait_s() const;
  void publish();
  void answer_broker();
  void pull();
  void ask_states();
  void keep_held();
  void tick_receiver();
  bool is_done();

  std::uint64_t generation = 0;
  std::string last_trouble;
  int times_troubled = 0;
  static constexpr double kLongAgo_s = -1e9;
  double gone_s = kLongAgo_s;  // when the broker first said that a stream or consumer was gone
  double ensured_s = -1e9, ensure_every_s = 0.0, kept_s = 0.0, ticked_s = 0.0;
};

}  // namespace mapweave::transport
