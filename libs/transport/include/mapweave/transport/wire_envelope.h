#pragma once
// Envelopes as they go over a network: parts of at most 256 KiB, each with a header that says of which message it is
// which part. A broker that was killed lost confirmed messages of 5 MiB, and none of 256 KiB (NATS 2.9.10).
//
// A part, numbers in little-endian order:
//   0   4  "MWEV"
//   4   1  schema version
//   5   1  kind
//   6   1  flags: 1 = last_counts
//   7   1  priority class
//   8   8  session    of the channel that sent it
//   16  8  number     of the message within its session and class, from 1
//   24  8  sequence   of the envelope; 0: it has none
//   32  4  part       from 0
//   36  4  parts
//   40  4  bytes      of the whole message
//   44  2  bytes of the subject
//   46  2  bytes of the sender
//   48  32 SHA-256 of the message and of what its header says, the part's index left out
//   80     subject, sender, this part of the bytes
// All functions are pure. What is read is hostile: every length is checked before it is believed.

#include <mapweave/core/hash.h>
#include <mapweave/transport/channel.h>

#include <string_view>
#include <variant>

namespace mapweave::transport {

inline constexpr std::uint8_t kWireVersion = 1;
inline constexpr std::size_t kMostPartBytes = std::size_t{256} << 10;  // with its header
inline constexpr std::size_t kMostWireNameBytes = 512;                 // of a subject, and of a sender
inline constexpr std::size_t kWireHeaderBytes = 80;

enum class WireKind : std::uint8_t { message = 0, opens = 1, closes = 2 };

// What every part says of its message.
struct WireHeader {
  WireKind kind = WireKind::message;
  std::uint8_t priority = 0;
  std::uint64_t session = 0, number = 0;
  std::uint32_t parts = 1, bytes = 0;
  Hash hash;
};

struct WirePart {
  WireHeader header;
  std::uint32_t part = 0;
  std::string subject, sender;
  std::uint64_t sequence = 0;
  bool last_counts = false;
  std::string_view bytes;  // of the buffer that was decoded
};

// Why something that came is not taken.
enum class WireRefusal : std::uint8_t {
  not_an_envelope,   // other bytes, or cut short
  unknown_version,   // of another program version
  too_long,          // message, part or name
  impossible_part,   // numbers that cannot be: a part too many, no parts, an unknown kind
  contradiction,     // of other parts of the same message
  wrong_hash,        // complete, and not what was sent
  incomplete,        // its other parts did not come in time
  too_fast,          // more bytes or parts a second than one sender may send
  too_many_senders,  // more than are kept apart
};
inline constexpr std::size_t kWireRefusals = 9;
const char* to_text(WireRefusal);

// The refusal, or the part.
std::variant<WireRefusal, WirePart> decode_part(std::string_view bytes);

// The hash of an envelope with the header's kind, priority, session and number.
Hash wire_hash(const WireHeader&, const Envelope&);

// Cuts envelopes. part_bytes: with the header, at least 4096 and at most kMostPartBytes.
class WireMessage {
 public:
  // Contract: names of at most kMostWireNameBytes, less than 4 GiB of bytes.
  WireMessage(Envelope envelope, WireKind kind, std::uint8_t priority, std::uint64_t session, std::uint64_t number,
              std::size_t part_bytes);
  const WireHeader& header() const { return header_; }
  const Envelope& envelope() const { return envelope_; }
  std::string part(std::uint32_t index) const;  // encoded
  std::size_t part_size(std::uint32_t index) const;

 private:
  Envelope envelope_;
  WireHeader header_;
  std::size_t share_ = 0;  // bytes of the message in each part but the last
};

}  // namespace mapweave::transport
