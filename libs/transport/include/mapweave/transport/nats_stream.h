#pragma once
// What a broker keeps on its disk (NATS JetStream): streams that refuse what has no room rather than forget, and
// consumers that remember what a reader has acknowledged. The JSON API is
// https://docs.nats.io/reference/reference-protocols/nats_api_reference. All calls are thread-safe; those with a
// patience wait for the broker, the others do not, and their answers come on the connection's thread.

#include <mapweave/transport/nats_connection.h>

#include <vector>

namespace mapweave::transport {

struct StreamOptions {
  std::string name;                                   // letters, digits, '_', '-'
  std::vector<std::string> subjects;                  // that it keeps
  std::string domain;                                 // whose broker keeps it; empty: the one that is connected
  std::uint64_t most_bytes = std::uint64_t{1} << 30;  // more are refused
  double repetitions_s = 120.0;                       // for so long a message id that comes again is known
};

struct StreamState {
  std::uint64_t messages = 0, bytes = 0, first = 0, last = 0;
};

// What became of a message that was published.
struct Publication {
  enum class Outcome { stored, full, no_stream, refused };
  Outcome outcome = Outcome::refused;
  std::uint64_t number = 0;    // within the stream
  bool is_repetition = false;  // it was there already
  std::string reason;
};
Publication publication_of(const NatsMessage& answer);

class NatsStream {
 public:
  NatsStream(std::shared_ptr<NatsConnection> connection, StreamOptions options);
  const StreamOptions& options() const { return options_; }

  // Makes it where it is missing, and sets its limits. True: it was missing, or somebody has deleted it since the last
  // call and made it anew: nothing of before is in it. Throws Error: kMissing where the broker does not answer,
  // kUnsupported without JetStream, kBadInput where it refuses (another stream has the subjects; no disk for so many
  // bytes).
  bool ensure(std::chrono::milliseconds patience);
  // nullopt: there is no such stream. Throws Error(kMissing) where the broker does not answer.
  std::optional<StreamState> state(std::chrono::milliseconds patience) const;
  // Takes away what was kept of a subject before a number.
  void purge(const std::string& subject, std::uint64_t before) const;
  void remove() const;  // with all that is in it
  // Confirmed once it is on the broker's disk cache; of a broker that is killed, large messages may be missing
  // (wire_envelope.h), so that only the receiver's word counts. Throws Error(kMissing) where no answer came.
  Publication publish(const std::string& subject, std::string_view bytes, const std::string& message_id,
                      std::chrono::milliseconds patience) const;

 private:
  std::shared_ptr<NatsConnection> connection_;
  StreamOptions options_;
  std::string created_;  // when, as the broker says; empty: never asked
};

struct ConsumerOptions {
  std::string stream, domain;
  std::string name;        // durable: it outlives its reader and the broker; letters, digits, '_', '-', '='
  std::string subject;     // of the stream's, those that it reads
  double repeat_s = 30.0;  // what is not acknowledged for so long is delivered again
  std::int64_t most_unacknowledged = 1024;  // messages; more are not delivered meanwhile: back-pressure
};

struct ConsumerState {
  std::uint64_t acknowledged = 0;  // of the stream's numbers, up to there
  std::uint64_t delivered = 0;     // up to there
  std::uint64_t waiting = 0;       // messages that were never delivered
  std::uint64_t readers = 0;       // requests of pull() that wait; 0: perhaps nobody reads
  std::string created;             // when it was made; another one: it was made again
};
std::optional<ConsumerState> consumer_state_of(const NatsMessage& answer);

// One program reads by it at a time. Any broker's domain that is connected can be read.
class NatsConsumer {
 public:
  NatsConsumer(std::shared_ptr<NatsConnection> connection, ConsumerOptions options);
  const ConsumerOptions& options() const { return options_; }

  // Makes it where it is missing, and sets its limits. True: it was missing. Throws Error as NatsStream::ensure;
  // kMissing also without the stream.
  bool ensure(std::chrono::milliseconds patience);
  // Delivers all that is not acknowledged at once, in the stream's order, as if nothing of it had been delivered.
  void restart(std::chrono::milliseconds patience);
  // nullopt: there is no such consumer.
  std::optional<ConsumerState> state(std::chrono::milliseconds patience) const;

  // Asks for messages: to the inbox's subject, at most so many and within that time; then a message with a status
  // comes where there were less. False: no connection.
  bool pull(const std::string& inbox, int messages, double within_s) const;
  // Asks for consumer_state_of(), to the inbox's subject.
  bool ask_state(const std::string& inbox) const;
  // Of a delivered message, by its reply subject: done with it; never again; still busy with it.
  bool acknowledge(const std::string& reply) const { return connection_->publish(reply, "+ACK"); }
  bool refuse(const std::string& reply) const { return connection_->publish(reply, "+TERM"); }
  bool keep(const std::string& reply) const { return connection_->publish(reply, "+WPI"); }

 private:
  std::string api(const std::string& what) const;
  void remake(const std::optional<ConsumerState>& before, std::chrono::milliseconds patience);
  std::shared_ptr<NatsConnection> connection_;
  ConsumerOptions options_;
};

// A name as a token of a subject: what is no letter, digit, '_' or '-' becomes '=' and two hexadecimal digits.
std::string nats_token(std::string_view name);

}  // namespace mapweave::transport
