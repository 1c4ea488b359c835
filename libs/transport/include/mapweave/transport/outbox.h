#pragma once
// What a sender keeps until the receiver has said that it has it.

#include <mapweave/transport/channel.h>

#include <deque>

namespace mapweave::transport {

// Of numbered messages, each sender's in rising order. It is emptied by the receiver's own word (maps/receipt.h), not
// by what carries messages: a network's servers lose what they confirmed. Not thread-safe.
class Outbox {
 public:
  virtual ~Outbox() = default;

  // false: the sender keeps together what is new until there is room.
  virtual bool has_room() const = 0;
  virtual void append(Envelope envelope) = 0;
  // Those that are not in flight, in the order in which they were appended; they are from now on.
  virtual std::vector<Envelope> take_due() = 0;
  // It did not get there, or is awaited: it is due again.
  virtual void repeat(const std::string& sender, std::uint64_t sequence) = 0;
  virtual void repeat_all() = 0;
  // The receiver has all up to this one.
  virtual void forget(const std::string& sender, std::uint64_t up_to) = 0;
  virtual std::size_t bytes() const = 0;
};

// Gone when the process ends: what it held is made again from what the sender has.
class MemoryOutbox : public Outbox {
 public:
  // There is room while it holds less.
  explicit MemoryOutbox(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  bool has_room() const override { return bytes_ < most_bytes_; }
  void append(Envelope envelope) override;
  std::vector<Envelope> take_due() override;
  void repeat(const std::string& sender, std::uint64_t sequence) override;
  void repeat_all() override;
  void forget(const std::string& sender, std::uint64_t up_to) override;
  std::size_t bytes() const override { return bytes_; }

 private:
  struct Kept {
    Envelope envelope;
    bool is_in_flight = false;
  };
  std::size_t most_bytes_, bytes_ = 0;
  std::deque<Kept> kept_;
};

}  // namespace mapweave::transport
