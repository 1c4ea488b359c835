#pragma once
// Messages from parts that come over a network in any order, twice, or never (wire_envelope.h). Memory is bounded
// whatever comes; what is not taken is counted by reason.

#include <mapweave/transport/wire_envelope.h>

#include <array>
#include <map>
#include <optional>
#include <tuple>

namespace mapweave::transport {

// Of one sender, but for the first.
struct ReassemblyLimits {
  std::size_t senders = 256;                           // that are kept apart; each has the limits below
  std::size_t message_bytes = std::size_t{64} << 20;   // longest message
  std::size_t waiting_bytes = std::size_t{128} << 20;  // of incomplete messages; at least twice the longest one
  std::size_t waiting_messages = 64;                   // that are not complete
  double patience_s = 60.0;                            // after its last part a message is given up
  double bytes_per_s = 64e6, parts_per_s = 20e3;       // in the mean; 0: unlimited
  double burst_s = 4.0;                                // that much of it at once
};

// Not thread-safe. Times are the caller's, in seconds, and never run backwards.
class Reassembly {
 public:
  explicit Reassembly(ReassemblyLimits limits);

  struct Message {
    WireHeader header;
    Envelope envelope;
    std::vector<std::string> tags;  // of its parts, in their order; of a part that came twice the last one
  };
  struct Result {
    std::optional<WireRefusal> refusal;  // of this part
    std::optional<Message> message;      // complete by this part
    std::vector<std::string> given_up;   // tags of parts that are not kept any more, this one too if it is refused
  };
  // sender: who sent it by the network's word, not by its own. tag: the caller's, for its acknowledgement.
  Result add(const std::string& sender, std::string_view part, std::string tag, double now_s);
  // Tags of messages that waited too long.
  std::vector<std::string> expire(double now_s);
  // Tags of all parts that wait.
  std::vector<std::string> tags() const;

  std::size_t waiting_bytes() const { return waiting_bytes_; }  // with what keeping them takes
  std::uint64_t refused(WireRefusal reason) const { return refused_[static_cast<std::size_t>(reason)]; }

 private:
  using Key = std::tuple<std::uint64_t, std::uint8_t, std::uint64_t, Hash>;  // session, priority, number, hash
  struct ReceivedPart {
    std::string bytes, tag;
  };
  struct IncompleteMessage {
    WireHeader header;
    Envelope envelope;  // without bytes
    std::map<std::uint32_t, ReceivedPart> parts;
    std::size_t bytes = 0, cost = 0;
    double last_s = 0.0;
  };
  struct Sender {
    std::map<Key, IncompleteMessage> waiting;
    std::size_t cost = 0;
    double allowed_bytes = 0.0, allowed_parts = 0.0, last_s = 0.0;
  };
  void count(WireRefusal reason) { ++refused_[static_cast<std::size_t>(reason)]; }
  Sender* sender_named(const std::string& name, double now_s);
  bool is_allowed(Sender& sender, std::size_t bytes, double now_s) const;
  std::optional<WireRefusal> keep(Sender& sender, const WirePart& part, std::string& tag, Result& result);
  bool make_room(Sender& sender, const Key& keep, std::size_t cost, std::vector<std::string>& given_up);
  void drop(Sender& sender, std::map<Key, IncompleteMessage>::iterator one, std::vector<std::string>& given_up);

  ReassemblyLimits limits_;
  std::map<std::string, Sender> senders_;
  std::size_t waiting_bytes_ = 0;
  std::array<std::uint64_t, kWireRefusals> refused_{};
};

}  // namespace mapweave::transport
