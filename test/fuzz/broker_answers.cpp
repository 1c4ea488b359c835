// What a broker answers: JSON of JetStream, as anybody may send it who can publish to an inbox.

#include "fuzz_target.h"

#include <mapweave/transport/nats_stream.h>
#include <nats/jetstream_api.h>

namespace mapweave::fuzz {
namespace {

using namespace transport;

NatsMessage message_of(std::string_view bytes) {
  NatsMessage message;
  message.bytes = std::string(bytes);
  return message;
}

constexpr char kRefused[] = R"({"error": {"code": 503, "err_code": 10077, "description": "maximum bytes exceeded"}})";

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {[](std::string_view bytes) { publication_of(message_of(bytes)); },
       {R"({"stream": "MAPS", "seq": 7, "duplicate": true})", kRefused,
        R"({"error": {"code": 404, "err_code": 10059, "description": "stream not found"}})"}},
      {[](std::string_view bytes) { consumer_state_of(message_of(bytes)); },
       {R"({"config": {"opt_start_seq": 3}, "ack_floor": {"stream_seq": 5}, "delivered": {"stream_seq": 7},
            "num_pending": 2, "num_waiting": 1})",
        kRefused}},
      {[](std::string_view bytes) { word_of(nlohmann::json::parse(bytes, nullptr, false), kWhere); },
       {R"({"message": {"subject": "mw.s.n", "seq": 4, "data": "YWxwaGE=", "time": "2026-11-25T23:36:34.123456789Z"}})",
        R"({"error": {"code": 404, "err_code": 10037, "description": "no message found"}})"}}};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
