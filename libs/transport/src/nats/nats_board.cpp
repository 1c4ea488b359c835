#include "jetstream_api.h"

#include <mapweave/core/error.h>
#include <mapweave/transport/nats_board.h>
#include <mapweave/transport/nats_stream.h>

#include <openssl/evp.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>

namespace mapweave::transport {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kLongest = std::size_t{256} << 10;
constexpr std::int64_t kMostBytes = std::int64_t{64} << 20;
constexpr int kMissingMessage = 10037, kNameInUse = 10058;

std::string decoded(const std::string& base64, const std::string& where) {
  std::string bytes(base64.size() / 4 * 3, '\0');
  const int size =
      EVP_DecodeBlock(reinterpret_cast<unsigned char*>(bytes.data()),
                      reinterpret_cast<const unsigned char*>(base64.data()), static_cast<int>(base64.size()));
  if (size < 0 || base64.size() % 4 != 0) throw Error(ErrorCode::kCorrupt, "a word that is not base64", where);
  std::size_t padding = 0;
  while (padding < base64.size() && base64[base64.size() - 1 - padding] == '=') ++padding;
  bytes.resize(static_cast<std::size_t>(size) - std::min<std::size_t>(padding, static_cast<std::size_t>(size)));
  return bytes;
}

// "2026-11-25T23:36:34.123456789Z"
std::chrono::system_clock::time_point time_of(const std::string& text, const std::string& where) {
  std::tm parts{};
  const char* rest = ::strptime(text.c_str(), "%Y-%m-%dT%H:%M:%S", &parts);
  if (rest == nullptr) throw Error(ErrorCode::kCorrupt, "a time that is none: '" + text + "'", where);
  const double fraction = *rest == '.' ? std::min(1.0, std::strtod(rest, nullptr)) : 0.0;
  if (parts.tm_year < 70 || parts.tm_year > 300)  // what a clock in nanoseconds can say
    throw Error(ErrorCode::kCorrupt, "a message has no time: '" + text + "'", where, "see what answers as the broker");
  return std::chrono::system_clock::from_time_t(::timegm(&parts)) +
         std::chrono::duration_cast<std::chrono::system_clock::duration>(std::chrono::duration<double>(fraction));
}

}  // namespace

NatsBoard::NatsBoard(std::shared_ptr<NatsConnection> connection, std::string stream, std::string domain)
    : connection_(std::move(connection)), stream_(std::move(stream)), domain_(std::move(domain)) {}

std::string NatsBoard::subject_of(const std::string& stream, const std::string& name) {
  return "mw." + stream + "." + nats_token(name);
}

void NatsBoard::ensure(std::chrono::milliseconds patience) {
  if (ask_stream(*connection_, domain_, stream_, patience)) return;
  const Json wanted = {{"name", stream_},           {"subjects", {"mw." + stream_ + ".*"}},
                       {"retention", "limits"},     {"discard", "old"},
                       {"storage", "file"},         {"num_replicas", 1},
                       {"max_msgs_per_subject", 1}, {"max_msg_size", kLongest},
                       {"max_bytes", kMostBytes}};
  const Json made = ask_jetstream(*connection_, api_of(domain_, "STREAM.CREATE." + stream_), wanted, patience);
  if (const int code = error_code_of(made); code != 0 && code != kNameInUse)
    throw_refused(*connection_, "to make stream '" + stream_ + "'", made);
}

bool NatsBoard::put(const std::string& name, std::string_view word) {
  return word.size() <= kLongest && connection_->publish(subject_of(stream_, name), word);
}

std::optional<NatsBoard::Word> NatsBoard::last(const std::string& name, std::chrono::milliseconds patience) const {
  if (!ask_stream(*connection_, domain_, stream_, patience)) return std::nullopt;
  return last_on(subject_of(stream_, name), patience);
}

std::vector<NatsBoard::Word> NatsBoard::words(std::chrono::milliseconds patience) const {
  if (!ask_stream(*connection_, domain_, stream_, patience)) return {};
  const Json answer = ask_jetstream(*connection_, api_of(domain_, "STREAM.INFO." + stream_),
                                    {{"subjects_filter", "mw." + stream_ + ".*"}}, patience);
  const int code = error_code_of(answer);
  if (code == kMissingStream) return {};
  if (code != 0 || !answer.contains("state") || !answer["state"].is_object())
    throw Error(ErrorCode::kBadInput, "the broker does not say who is on '" + stream_ + "'",
                connection_->state().server);
  std::vector<Word> words;
  const Json subjects = answer["state"].value("subjects", Json::object());
  for (const auto& entry : subjects.items())
    if (auto word = last_on(entry.key(), patience)) words.push_back(std::move(*word));
  return words;
}

std::optional<NatsBoard::Word> word_of(const Json& answer, const std::string& where) {
  const int code = error_code_of(answer);
  if (code == kMissingMessage || code == kMissingStream) return std::nullopt;
  if (code != 0) throw Error(ErrorCode::kBadInput, "the broker refuses: " + error_text_of(answer), where);
  try {
    const Json& message = answer.at("message");
    return NatsBoard::Word{decoded(message.value("data", ""), where), time_of(message.at("time"), where)};
  } catch (const Json::exception&) {
    throw Error(ErrorCode::kCorrupt, "the broker's answer holds no message", where);
  }
}

std::optional<NatsBoard::Word> NatsBoard::last_on(const std::string& subject,
                                                  std::chrono::milliseconds patience) const {
  const std::string where = connection_->state().server;
  const Json answer =
      ask_jetstream(*connection_, api_of(domain_, "STREAM.MSG.GET." + stream_), {{"last_by_subj", subject}}, patience);
  return word_of(answer, where);
}

}  // namespace mapweave::transport
