#pragma once
// A board that a broker's stream keeps.

#include <mapweave/transport/board.h>
#include <mapweave/transport/nats_connection.h>

#include <vector>

namespace mapweave::transport {

class NatsBoard : public Board {
 public:
  // stream: letters, digits, '_', '-'. domain: of the broker that keeps it; empty: the connected one. What is put goes
  // to the connected one and to all brokers that are connected with it and have the stream.
  NatsBoard(std::shared_ptr<NatsConnection> connection, std::string stream, std::string domain = {});
  static std::string subject_of(const std::string& stream, const std::string& name);

  void ensure(std::chrono::milliseconds patience) override;
  bool put(const std::string& name, std::string_view word) override;
  std::optional<Word> last(const std::string& name, std::chrono::milliseconds patience) const override;
  // Of all that ever said something; none where the stream is missing. Throws as last().
  std::vector<Word> words(std::chrono::milliseconds patience) const;

 private:
  std::optional<Word> last_on(const std::string& subject, std::chrono::milliseconds patience) const;

  std::shared_ptr<NatsConnection> connection_;
  std::string stream_, domain_;
};

}  // namespace mapweave::transport
