#pragma once
// Questions to the JSON API of JetStream.

#include <mapweave/transport/nats_board.h>

#include <nlohmann/json.hpp>

namespace mapweave::transport {

// request: null for none. Throws BrokerAway where no answer comes in time, or none has the JetStream that is asked;
// Error(kCorrupt) for an answer that is not JSON.
nlohmann::json ask_jetstream(NatsConnection& connection, const std::string& subject, const nlohmann::json& request,
                             std::chrono::milliseconds patience);
// The server's error code (errors.json of nats-server) in an answer; 0: none; 1: an error without a code. What kinds of
// values stand in an answer is the other end's word alone: both take any.
int error_code_of(const nlohmann::json& answer);
constexpr int kMissingStream = 10059;
// The subject of a question to the broker of a domain; empty: the connected one.
std::string api_of(const std::string& domain, const std::string& what);
// What the server says of its error: its description, else its code.
std::string error_text_of(const nlohmann::json& answer);
// Throws Error(kBadInput): the broker refuses what was asked.
[[noreturn]] void throw_refused(NatsConnection& connection, const std::string& what, const nlohmann::json& answer);

// How a stream stands: the answer to STREAM.INFO; nullopt: there is none yet. A stream that the broker is about to make
// counts as none: until 2.10 nats-server names it before it has its files, and a question about its messages or a
// consumer of it then ends the server. Throws as ask_jetstream(), and Error(kBadInput) where the broker refuses.
std::optional<nlohmann::json> ask_stream(NatsConnection& connection, const std::string& domain,
                                         const std::string& stream, std::chrono::milliseconds patience);

// The message of a stream in the answer to STREAM.MSG.GET; nullopt: there is none, or no stream. Throws Error:
// kBadInput where the broker refuses, kCorrupt for an answer that is none.
std::optional<NatsBoard::Word> word_of(const nlohmann::json& answer, const std::string& where);

}  // namespace mapweave::transport
