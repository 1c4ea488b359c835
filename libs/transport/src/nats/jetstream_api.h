#pragma once
// Questions to the JSON API of JetStream.

#include <mapweave/transport/nats_connection.h>

#include <nlohmann/json.hpp>

namespace mapweave::transport {

// request: null for none. Throws Error: kMissing where no answer comes in time, kUnsupported without JetStream,
// kCorrupt for an answer that is not JSON.
nlohmann::json ask_jetstream(NatsConnection& connection, const std::string& subject, const nlohmann::json& request,
                             std::chrono::milliseconds patience);
// The server's error code (errors.json of nats-server) in an answer; 0: none.
int error_code_of(const nlohmann::json& answer);

}  // namespace mapweave::transport
