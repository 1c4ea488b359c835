#pragma once
// A client's end of a channel to a live map server.

#include <mapweave/maps/receipt.h>
#include <mapweave/tiers/subjects.h>
#include <mapweave/transport/channel.h>

namespace mapweave::test {

struct Heard {
  std::string subject, bytes;
  std::vector<Receipt> receipts;  // of a welcome or of receipts
};
// What has come, acknowledged.
inline std::vector<Heard> take(transport::Channel& channel, std::chrono::milliseconds patience) {
  std::vector<Heard> all;
  for (transport::Channel::Delivery& one : channel.receive(patience)) {
    Heard heard{std::move(one.envelope.subject), std::move(one.envelope.bytes), {}};
    if (heard.subject == tiers::subject::kWelcome || heard.subject == tiers::subject::kReceipts)
      heard.receipts = decode_receipts(heard.bytes, "the map server");
    all.push_back(std::move(heard));
    channel.acknowledge(one.number);
  }
  return all;
}

}  // namespace mapweave::test
