#pragma once
// The receiving half of a channel over a broker's streams: parts in any order and twice become messages in order, once.
// Knows no network: what is to be said to the broker is taken from it, by the reply subjects of what came.

#include <mapweave/transport/reassembly.h>

#include <deque>
#include <map>
#include <set>
#include <utility>

namespace mapweave::transport {

struct ChannelReceiverOptions {
  bool accepts = false;        // the session that the other end opens; else its own
  std::uint64_t session = 0;   // its own
  std::size_t priorities = 1;  // classes
  ReassemblyLimits limits;
  // So long a missing message is waited for, and messages of a session that nobody has opened.
  double missing_s = 60.0, early_s = 3.0;
};

// A session is what one end of a channel says between its beginning and its end. Not thread-safe. Times: as
// BandwidthMeter.
class ChannelReceiver {
 public:
  explicit ChannelReceiver(ChannelReceiverOptions options);

  // part: as it was delivered for a class. reply: by which the broker is answered.
  void add(std::size_t priority, std::string_view part, const std::string& reply, double now_s);
  // Gives up what is late.
  void tick(double now_s);
  // What has come since, each class in order.
  std::vector<Channel::Delivery> take();
  bool has_ready() const { return !ready_.empty(); }
  void acknowledge(std::uint64_t delivery);

  // This end closes: what it did not acknowledge is forgotten.
  void close() { forget_all(); }

  // To be acknowledged: messages up to the first of their class that is not. To be refused for ever.
  std::vector<std::string> take_acknowledged() { return std::exchange(acknowledged_, {}); }
  std::vector<std::string> take_refused() { return std::exchange(refused_, {}); }
  // What was delivered and is neither.
  std::vector<std::string> held() const;

  std::uint64_t session() const { return session_; }  // 0: nobody has opened one yet
  bool is_closed() const { return is_closed_; }       // by the other end, or because it began another session
  // Sessions that it knows nothing of, as it began after them: their senders should know.
  std::vector<std::uint64_t> take_unknown_sessions() { return std::exchange(unknown_, {}); }

  struct Counts {
    std::uint64_t messages = 0, bytes = 0;  // taken, or ready to be
    std::uint64_t repeated = 0;             // came again
    std::uint64_t skipped = 0;              // messages that never came
    std::uint64_t stale = 0;                // of other sessions
  };
  const Counts& counts() const { return counts_; }
  std::uint64_t refused(WireRefusal reason) const { return reassembly_.refused(reason); }
  std::size_t bytes() const { return bytes_ + reassembly_.waiting_bytes(); }  // in memory

 private:
  struct Held {
    std::uint64_t delivery = 0;  // 0: a control message
    bool is_acknowledged = false;
    std::vector<std::string> replies;
    std::size_t bytes = 0;
  };
  struct Class {
    std::uint64_t next = 1;
    std::map<std::uint64_t, Reassembly::Message> waiting;  // for those before them
    std::map<std::uint64_t, Held> held;                    // delivered, by number
    std::set<std::uint64_t> skipped;
    std::optional<double> missing_since_s;
    std::optional<Hash> first;  // of message 1
  };
  struct Early {
    std::size_t priority;
    Reassembly::Message message;
    double since_s;
    // It came before what opened this session, in the class where that comes first: what an older session left.
    bool is_left_over = false;
  };
  bool is_repetition(std::size_t priority, const WirePart& part, const std::string& reply);
  void route(std::size_t priority, Reassembly::Message message, double now_s);
  void route_of_another(std::size_t priority, Reassembly::Message message, double now_s);
  void order(std::size_t priority, Reassembly::Message message, double now_s);
  void deliver(Class& one, std::uint64_t number, Reassembly::Message message);
  void deliver_next(Class& one, double now_s);
  void release(Class& one);
  // next: the session that follows; 0: not known.
  void clear_left_over(std::uint64_t next);
  void forget_all(std::uint64_t next = 0);
  void acknowledge(std::vector<std::string>&& replies);

  ChannelReceiverOptions options_;
  std::uint64_t session_ = 0, deliveries_ = 0;
  bool is_closed_ = false;
  Reassembly reassembly_;
  std::vector<Class> classes_;
  std::deque<Early> early_;
  std::map<std::uint64_t, std::pair<std::size_t, std::uint64_t>> delivered_;  // class and number by delivery
  std::vector<Channel::Delivery> ready_;
  std::vector<std::string> acknowledged_, refused_;
  std::vector<std::uint64_t> unknown_;
  Counts counts_;
  std::size_t bytes_ = 0;
};

// Of the message that ends a session at once, whatever has come of it: from one who does not know it.
inline constexpr std::uint64_t kEndNumber = ~std::uint64_t{0};

}  // namespace mapweave::transport
