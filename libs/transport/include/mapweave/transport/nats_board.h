#pragma once
// The last word of each of several programs, kept by a broker's stream for who asks later: what a program said last is
// there although it has ended.

#include <mapweave/transport/nats_connection.h>

#include <vector>

namespace mapweave::transport {

// All calls are thread-safe. Names: any text. Of each name the last word alone is kept, of at most 256 KiB.
class NatsBoard {
 public:
  // stream: letters, digits, '_', '-'. domain: of the broker that keeps it; empty: the connected one. What is put goes
  // to the connected one and to all brokers that are connected with it and have the stream.
  NatsBoard(std::shared_ptr<NatsConnection> connection, std::string stream, std::string domain = {});
  static std::string subject_of(const std::string& stream, const std::string& name);

  // Makes the stream where it is missing. Throws Error: kMissing where the broker does not answer, kBadInput where it
  // refuses.
  void ensure(std::chrono::milliseconds patience);
  // Soon. False: there is no connection, or the word is too long. Where the stream is missing it is lost.
  bool put(const std::string& name, std::string_view word);
  struct Word {
    std::string bytes;
    std::chrono::system_clock::time_point stored;  // by the broker's clock
  };
  // nullopt: it never said anything. Throws Error as ensure, and kCorrupt for an answer that is none.
  std::optional<Word> last(const std::string& name, std::chrono::milliseconds patience) const;
  // Of all that ever said something; none where the stream is missing. Throws as last().
  std::vector<Word> words(std::chrono::milliseconds patience) const;

 private:
  std::optional<Word> last_on(const std::string& subject, std::chrono::milliseconds patience) const;

  std::shared_ptr<NatsConnection> connection_;
  std::string stream_, domain_;
};

}  // namespace mapweave::transport
