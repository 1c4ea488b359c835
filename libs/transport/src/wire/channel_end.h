#pragma once
// What every end of a channel has, whatever carries its parts: what it sends and what came, under one lock.

#include <mapweave/transport/channel_receiver.h>
#include <mapweave/transport/channel_sender.h>

#include <condition_variable>
#include <mutex>

namespace mapweave::transport {

struct ChannelEndOptions {
  bool opens = false;                                // the session; else it belongs to the first that it sees
  std::vector<std::vector<std::string>> priorities;  // as NatsChannelOptions
  ChannelSenderOptions sender;
  ReassemblyLimits received;
  double missing_s = 60.0, linger_s = 0.5;  // as NatsChannelOptions
};

std::uint64_t random_session();  // not 0

struct ChannelEnd {
  ChannelEnd(ChannelEndOptions options, std::uint64_t number);

  // As Channel has them.
  Channel::Sent send(Envelope envelope);
  std::size_t in_flight_bytes();
  std::vector<Channel::Delivery> receive(std::chrono::milliseconds patience);
  void acknowledge(std::uint64_t delivery);
  void set_listener(std::function<void()> call);
  void close();

  double now_s() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count(); }
  void call_listener();
  // A part that came for a class, and by what it is acknowledged. Calls the listener where that brings news.
  void take(std::size_t priority, std::string_view part, const std::string& reply);
  // Ends a session that its other end opened before this program began.
  std::string end_of(std::uint64_t session) const;

  // --- Under the lock.
  bool is_closed() const { return closes || receiver.is_closed(); }
  // There is work for the thread.
  void stir() {
    is_stirred = true;
    changed.notify_all();
  }
  // Closed, and what was sent is with whoever confirms it, or never gets there.
  bool is_said() const { return sender.session() == 0 || sender.is_idle(); }
  Channel::Health health_now() const;

  const std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
  const ChannelEndOptions end_options;
  const std::uint64_t incarnation;  // a random number: of its session, or of who accepts

  std::mutex mutex;
  std::condition_variable changed, came;  // for the thread; for who receives
  ChannelSender sender;
  ChannelReceiver receiver;
  std::function<void()> listener;
  std::optional<double> received_at_s;
  std::uint64_t unconfirmed_parts = 0;
  bool closes = false, ends = false, is_stirred = false;
  double linger_until_s = 0.0;
};

}  // namespace mapweave::transport
