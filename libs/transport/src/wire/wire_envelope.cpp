#include <mapweave/core/error.h>
#include <mapweave/transport/wire_envelope.h>

#include <algorithm>
#include <cstring>

namespace mapweave::transport {
namespace {

constexpr char kMagic[] = "MWEV";
constexpr std::size_t kLeastPartBytes = 4096;

template <class Number>
void put(std::string& bytes, Number number) {
  for (std::size_t i = 0; i < sizeof number; ++i) bytes += static_cast<char>(number >> (8 * i) & 0xff);
}

template <class Number>
Number get(std::string_view bytes, std::size_t at) {
  Number number = 0;
  for (std::size_t i = 0; i < sizeof number; ++i)
    number = static_cast<Number>(
        number | static_cast<Number>(static_cast<Number>(static_cast<std::uint8_t>(bytes[at + i])) << (8 * i)));
  return number;
}

}  // namespace

const char* to_text(WireRefusal refusal) {
  switch (refusal) {
    case WireRefusal::not_an_envelope: return "it is no envelope, or cut short";
    case WireRefusal::unknown_version: return "its schema version is unknown; both programs must have one version";
    case WireRefusal::too_long: return "it is longer than what is taken";
    case WireRefusal::impossible_part: return "it counts its parts in an impossible manner";
    case WireRefusal::contradiction: return "it contradicts other parts of its message";
    case WireRefusal::wrong_hash: return "its bytes are not those that were sent";
    case WireRefusal::incomplete: return "other parts of its message are missing";
    case WireRefusal::too_fast: return "its sender sends more in a second than one may";
    case WireRefusal::too_many_senders: return "more senders than are kept apart";
  }
  return "unknown";
}

Hash wire_hash(const WireHeader& header, const Envelope& envelope) {
  Hasher hasher;
  hasher.add(static_cast<std::int64_t>(header.kind)).add(static_cast<std::int64_t>(header.priority));
  hasher.add(static_cast<std::int64_t>(header.session)).add(static_cast<std::int64_t>(header.number));
  hasher.add(static_cast<std::int64_t>(envelope.sequence)).add(static_cast<std::int64_t>(envelope.last_counts));
  return hasher.add(envelope.subject).add(envelope.sender).add(envelope.bytes).finish();
}

std::variant<WireRefusal, WirePart> decode_part(std::string_view bytes) {
  if (bytes.size() < 5 || bytes.substr(0, 4) != kMagic) return WireRefusal::not_an_envelope;
  if (static_cast<std::uint8_t>(bytes[4]) != kWireVersion) return WireRefusal::unknown_version;
  if (bytes.size() < kWireHeaderBytes) return WireRefusal::not_an_envelope;
  if (bytes.size() > kMostPartBytes) return WireRefusal::too_long;
  const std::size_t subject = get<std::uint16_t>(bytes, 44), sender = get<std::uint16_t>(bytes, 46);
  if (subject > kMostWireNameBytes || sender > kMostWireNameBytes) return WireRefusal::too_long;
  if (bytes.size() < kWireHeaderBytes + subject + sender) return WireRefusal::not_an_envelope;
  WirePart part;
  WireHeader& header = part.header;
  const auto kind = static_cast<std::uint8_t>(bytes[5]), flags = static_cast<std::uint8_t>(bytes[6]);
  header.kind = static_cast<WireKind>(kind);
  header.priority = static_cast<std::uint8_t>(bytes[7]);
  header.session = get<std::uint64_t>(bytes, 8);
  header.number = get<std::uint64_t>(bytes, 16);
  part.sequence = get<std::uint64_t>(bytes, 24);
  part.part = get<std::uint32_t>(bytes, 32);
  header.parts = get<std::uint32_t>(bytes, 36);
  header.bytes = get<std::uint32_t>(bytes, 40);
  std::memcpy(header.hash.bytes.data(), bytes.data() + 48, header.hash.bytes.size());
  part.last_counts = (flags & 1) != 0;
  part.subject = bytes.substr(kWireHeaderBytes, subject);
  part.sender = bytes.substr(kWireHeaderBytes + subject, sender);
  part.bytes = bytes.substr(kWireHeaderBytes + subject + sender);
  const bool is_possible =
      kind <= static_cast<std::uint8_t>(WireKind::closes) && flags <= 1 && header.number > 0 &&
      part.part < header.parts && part.bytes.size() <= header.bytes &&
      (header.parts > 1 ? !part.bytes.empty() && header.parts <= header.bytes : part.bytes.size() == header.bytes);
  if (!is_possible) return WireRefusal::impossible_part;
  return part;
}

WireMessage::WireMessage(Envelope envelope, WireKind kind, std::uint8_t priority, std::uint64_t session,
                         std::uint64_t number, std::size_t part_bytes)
    : envelope_(std::move(envelope)) {
  MAPWEAVE_EXPECT(envelope_.subject.size() <= kMostWireNameBytes && envelope_.sender.size() <= kMostWireNameBytes,
                  "names of an envelope are short");
  MAPWEAVE_EXPECT(envelope_.bytes.size() <= 0xffffffffU, "a message has less than 4 GiB");
  MAPWEAVE_EXPECT(part_bytes >= kLeastPartBytes && part_bytes <= kMostPartBytes, "parts are of 4 to 256 KiB");
  MAPWEAVE_EXPECT(number > 0, "messages count from 1");
  header_.kind = kind;
  header_.priority = priority;
  header_.session = session;
  header_.number = number;
  header_.bytes = static_cast<std::uint32_t>(envelope_.bytes.size());
  share_ = part_bytes - kWireHeaderBytes - envelope_.subject.size() - envelope_.sender.size();
  header_.parts = static_cast<std::uint32_t>(std::max<std::size_t>(1, (header_.bytes + share_ - 1) / share_));
  header_.hash = wire_hash(header_, envelope_);
}

std::string WireMessage::part(std::uint32_t index) const {
  MAPWEAVE_EXPECT(index < header_.parts, "a message has so many parts");
  std::string bytes(kMagic, 4);
  bytes.reserve(part_size(index));
  put(bytes, kWireVersion);
  put(bytes, static_cast<std::uint8_t>(header_.kind));
  put(bytes, static_cast<std::uint8_t>(envelope_.last_counts));
  put(bytes, header_.priority);
  put(bytes, header_.session);
  put(bytes, header_.number);
  put(bytes, envelope_.sequence);
  put(bytes, index);
  put(bytes, header_.parts);
  put(bytes, header_.bytes);
  put(bytes, static_cast<std::uint16_t>(envelope_.subject.size()));
  put(bytes, static_cast<std::uint16_t>(envelope_.sender.size()));
  bytes.append(reinterpret_cast<const char*>(header_.hash.bytes.data()), header_.hash.bytes.size());
  bytes += envelope_.subject;
  bytes += envelope_.sender;
  bytes.append(envelope_.bytes, index * share_, share_);
  return bytes;
}

std::size_t WireMessage::part_size(std::uint32_t index) const {
  const std::size_t from = index * share_;
  return kWireHeaderBytes + envelope_.subject.size() + envelope_.sender.size() +
         std::min(share_, envelope_.bytes.size() - from);
}

}  // namespace mapweave::transport
