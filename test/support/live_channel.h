#pragma once
// A client's end of a channel to a live camera map server.

#include <mapweave/maps/receipt.h>
#include <mapweave/tiers/subjects.h>
#include <mapweave/transport/channel.h>

namespace mapweave::test {

struct ReceivedMessage {
  std::string subject, bytes;
  std::vector<Receipt> receipts;  // of a welcome or of receipts
};
// What has come, acknowledged.
inline std::vector<ReceivedMessage> take(transport::Channel& channel, std::chrono::milliseconds patience) {
  std::vector<ReceivedMessage> all;
  for (transport::Channel::Delivery& one : channel.receive(patience)) {
    ReceivedMessage received{std::move(one.envelope.subject), std::move(one.envelope.bytes), {}};
    if (received.subject == tiers::subject::kWelcome || received.subject == tiers::subject::kReceipts)
      received.receipts = decode_receipts(received.bytes, "the map server");
    all.push_back(std::move(received));
    channel.acknowledge(one.number);
  }
  return all;
}

}  // namespace mapweave::test
