#include <mapweave/transport/in_process_channel.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <utility>

namespace mapweave::transport {
namespace {

// One way.
struct Direction {
  ChannelLimits limits;
  std::deque<Channel::Delivery> waiting;
  std::map<std::uint64_t, std::size_t> in_flight;  // bytes by number, waiting or received
  std::size_t bytes = 0;                           // of those
  std::uint64_t numbered = 0;
  std::condition_variable changed;
  std::function<void()> listener;  // of the end that receives

  Channel::Sent put(Envelope envelope) {
    const std::size_t size = envelope.bytes.size();
    if (size > limits.bytes) return Channel::Sent::never;
    const auto replaced = std::find_if(waiting.begin(), waiting.end(), [&](const Channel::Delivery& one) {
      return envelope.last_counts && one.envelope.last_counts && one.envelope.subject == envelope.subject &&
             one.envelope.sender == envelope.sender;
    });
    if (replaced != waiting.end()) {
      std::size_t& before = in_flight.at(replaced->number);
      bytes += size - before;
      before = size;
      replaced->envelope = std::move(envelope);
      return Channel::Sent::taken;
    }
    if (bytes + size > limits.bytes || in_flight.size() >= limits.messages) return Channel::Sent::later;
    in_flight.emplace(++numbered, size);
    bytes += size;
    waiting.push_back({std::move(envelope), numbered});
    return Channel::Sent::taken;
  }
};

struct Shared {
  std::mutex mutex;
  std::array<Direction, 2> directions;  // by the end that sends
  bool is_closed = false;
};

class End : public Channel {
 public:
  End(std::shared_ptr<Shared> shared, std::size_t side)
      : shared_(std::move(shared)), out_(shared_->directions[side]), in_(shared_->directions[1 - side]) {}
  ~End() override {
    set_listener(nullptr);
    close();
  }

  Sent send(Envelope envelope) override {
    std::function<void()> listener;
    {
      const std::lock_guard lock(shared_->mutex);
      if (shared_->is_closed) return Sent::never;
      if (const Sent sent = out_.put(std::move(envelope)); sent != Sent::taken) return sent;
      out_.changed.notify_all();
      listener = out_.listener;
    }
    if (listener) listener();
    return Sent::taken;
  }

  std::size_t in_flight_bytes() const override {
    const std::lock_guard lock(shared_->mutex);
    return out_.bytes;
  }

  std::vector<Delivery> receive(std::chrono::milliseconds patience) override {
    std::unique_lock lock(shared_->mutex);
    in_.changed.wait_for(lock, patience, [&] { return shared_->is_closed || !in_.waiting.empty(); });
    std::vector<Delivery> received(std::make_move_iterator(in_.waiting.begin()),
                                   std::make_move_iterator(in_.waiting.end()));
    in_.waiting.clear();
    return received;
  }

  void acknowledge(std::uint64_t delivery) override {
    const std::lock_guard lock(shared_->mutex);
    const auto known = in_.in_flight.find(delivery);
    if (known == in_.in_flight.end()) return;
    in_.bytes -= known->second;
    in_.in_flight.erase(known);
  }

  void set_listener(std::function<void()> listener) override {
    {
      const std::lock_guard lock(shared_->mutex);
      in_.listener = listener;
    }
    if (listener) listener();
  }

  void close() override {
    std::function<void()> listener;
    {
      const std::lock_guard lock(shared_->mutex);
      if (std::exchange(shared_->is_closed, true)) return;
      in_.changed.notify_all();
      out_.changed.notify_all();
      listener = out_.listener;
    }
    if (listener) listener();
  }

  bool is_closed() const override {
    const std::lock_guard lock(shared_->mutex);
    return shared_->is_closed;
  }

 private:
  std::shared_ptr<Shared> shared_;
  Direction &out_, &in_;
};

}  // namespace

InProcessChannel make_in_process_channel(ChannelLimits from_first, ChannelLimits from_second) {
  const auto shared = std::make_shared<Shared>();
  shared->directions[0].limits = from_first;
  shared->directions[1].limits = from_second;
  return {std::make_shared<End>(shared, 0), std::make_shared<End>(shared, 1)};
}

}  // namespace mapweave::transport
