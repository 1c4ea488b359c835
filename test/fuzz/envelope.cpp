// Parts of messages as they come over a network, of several senders, in any order.

#include "fuzz_target.h"

#include <mapweave/transport/reassembly.h>

#include <algorithm>
#include <cstring>

namespace mapweave::fuzz {
namespace {

using namespace transport;

constexpr std::size_t kHashPlace = 48, kSenders = 4, kWaitingBytes = 64 << 10;

// One part in an input: who sends it, whether its hash is made right, its length, its bytes.
std::string piece(std::size_t sender, bool is_sealed, const std::string& part) {
  return {static_cast<char>(sender | (is_sealed ? 0x80 : 0)), static_cast<char>(part.size() & 0xff),
          static_cast<char>(part.size() >> 8)};
}

std::string input_of(const WireMessage& message, std::size_t sender, bool is_sealed, bool is_reversed) {
  std::string input;
  for (std::uint32_t i = 0; i < message.header().parts; ++i) {
    const std::string part = message.part(is_reversed ? message.header().parts - 1 - i : i);
    input += piece(sender, is_sealed, part) + part;
  }
  return input;
}

WireMessage message_of(std::size_t bytes, WireKind kind = WireKind::message) {
  return {{"update", std::string(bytes, 'x'), "alpha", 7}, kind, 2, 99, 1, 4096};
}

// A message of one part gets the hash of what it says, or nothing would be learnt behind that check.
std::string sealed(std::string part) {
  const auto decoded = decode_part(part);
  const auto* read = std::get_if<WirePart>(&decoded);
  if (read == nullptr || read->header.parts != 1) return part;
  Envelope envelope;
  envelope.subject = read->subject;
  envelope.bytes = std::string(read->bytes);
  envelope.sender = read->sender;
  envelope.sequence = read->sequence;
  envelope.last_counts = read->last_counts;
  const Hash hash = wire_hash(read->header, envelope);
  std::memcpy(part.data() + kHashPlace, hash.bytes.data(), hash.bytes.size());
  return part;
}

void expect_same(const Reassembly::Message& message) {
  const WireMessage again(message.envelope, message.header.kind, message.header.priority, message.header.session,
                          message.header.number, 4096);
  expect(again.header().hash == message.header.hash, "a message has the hash that its parts say");
}

}  // namespace

std::vector<std::string> seeds() {
  return {input_of(message_of(10), 0, false, false), input_of(message_of(10), 1, true, false),
          input_of(message_of(9000), 0, false, true),
          input_of(message_of(5000), 2, false, false) + input_of(message_of(0, WireKind::opens), 3, true, false)};
}

void decode(std::string_view bytes) {
  ReassemblyLimits limits;
  limits.senders = kSenders - 1;
  limits.waiting_bytes = kWaitingBytes;
  limits.message_bytes = kWaitingBytes / 2;
  limits.waiting_messages = 4;
  Reassembly reassembly(limits);
  double now_s = 0.0;
  while (bytes.size() >= 3) {
    const auto byte = [&](std::size_t at) { return static_cast<std::size_t>(static_cast<unsigned char>(bytes[at])); };
    const std::size_t first = byte(0), size = std::min(byte(1) | byte(2) << 8, bytes.size() - 3);
    std::string part(bytes.substr(3, size));
    bytes.remove_prefix(3 + size);
    if ((first & 0x80) != 0) part = sealed(std::move(part));
    const auto result = reassembly.add("sender" + std::to_string(first % kSenders), part, "tag", now_s += 0.01);
    if (result.message) expect_same(*result.message);
    expect(reassembly.waiting_bytes() <= limits.senders * limits.waiting_bytes, "what waits is bounded");
  }
  reassembly.expire(now_s + 1e6);
  expect(reassembly.waiting_bytes() == 0 && reassembly.tags().empty(), "nothing waits forever");
}

}  // namespace mapweave::fuzz
