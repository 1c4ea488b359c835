#include "jetstream_api.h"

#include <mapweave/core/error.h>
#include <mapweave/core/hash.h>
#include <mapweave/transport/nats_stream.h>

#include <algorithm>
#include <thread>
#include <utility>

namespace mapweave::transport {
namespace {

using Json = nlohmann::json;
using std::chrono::milliseconds;

// Of the server's error codes (errors.json of nats-server).
constexpr int kConsumerMissing = 10014, kNameInUse = 10058, kConsumerInUse = 10013, kConsumerExists = 10105,
              kDurableDiffers = 10106;
constexpr int kFull[] = {10077, 10047, 10023, 10028, 10002};  // no room: of the stream, the disk, the account

constexpr milliseconds kPause{10};  // until one looks again whether a stream is made that another makes

std::int64_t nanoseconds(double seconds) { return static_cast<std::int64_t>(seconds * 1e9); }

// What a broker's answer says; hostile as all that comes.
template <class Use>
auto read(const Json& answer, const Use& use) -> std::optional<decltype(use(answer))> {
  try {
    return use(answer);
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

// A number of messages, or of one; throws Json::exception for what is none.
std::uint64_t count_at(const Json& json, const char* key) {
  return json.at(key).get_ref<const Json::number_unsigned_t&>();
}
std::uint64_t count_at(const Json& json, const char* key, std::uint64_t otherwise) {
  return json.is_object() && !json.contains(key) ? otherwise : count_at(json, key);
}

std::optional<ConsumerState> consumer_state(const Json& answer) {
  if (error_code_of(answer) != 0) return std::nullopt;
  return read(answer, [](const Json& json) {
    // Of a consumer that was made again the server says 0 until something is acknowledged.
    const std::uint64_t from = count_at(json.at("config"), "opt_start_seq", 1);
    const std::uint64_t acknowledged = count_at(json.at("ack_floor"), "stream_seq");
    return ConsumerState{std::max(acknowledged, from - std::min<std::uint64_t>(from, 1)),
                         count_at(json.at("delivered"), "stream_seq"), count_at(json, "num_pending"),
                         count_at(json, "num_waiting", 0), json.value("created", "")};
  });
}

}  // namespace

Publication publication_of(const NatsMessage& answer) {
  using Outcome = Publication::Outcome;
  if (answer.status == 503) return {Outcome::no_stream, 0, false, "no stream keeps this subject"};
  const Json json = Json::parse(answer.bytes, nullptr, false);
  if (const int code = error_code_of(json); code != 0) {
    for (const int full : kFull)
      if (code == full) return {Outcome::full, 0, false, error_text_of(json)};
    return {code == kMissingStream ? Outcome::no_stream : Outcome::refused, 0, false, error_text_of(json)};
  }
  const auto stored = read(json, [](const Json& one) {
    return Publication{Outcome::stored, count_at(one, "seq"), one.value("duplicate", false), {}};
  });
  return stored ? *stored : Publication{Outcome::refused, 0, false, "an answer that is none"};
}

std::optional<ConsumerState> consumer_state_of(const NatsMessage& answer) {
  return consumer_state(Json::parse(answer.bytes, nullptr, false));
}

NatsStream::NatsStream(std::shared_ptr<NatsConnection> connection, StreamOptions options)
    : connection_(std::move(connection)), options_(std::move(options)) {}

bool NatsStream::ensure(milliseconds patience) {
  const Json wanted = {{"name", options_.name},
                       {"subjects", options_.subjects},
                       {"retention", "limits"},
                       {"discard", "new"},
                       {"storage", "file"},
                       {"num_replicas", 1},
                       {"max_consumers", -1},
                       {"max_msgs", -1},
                       {"max_msg_size", -1},
                       {"max_age", 0},
                       {"max_bytes", options_.most_bytes},
                       {"duplicate_window", nanoseconds(options_.repetitions_s)}};
  const auto ask = [&](const std::string& what, const Json& request) {
    return ask_jetstream(*connection_, api_of(options_.domain, "STREAM." + what + "." + options_.name), request,
                         patience);
  };
  const auto known = ask_stream(*connection_, options_.domain, options_.name, patience);
  const auto created = [](const Json& answer) {
    return read(answer, [](const Json& json) { return json.value("created", ""); }).value_or("");
  };
  if (known) {
    const std::string before = std::exchange(created_, created(*known));
    const bool is_another = !before.empty() && before != created_;
    const bool is_as_wanted =
        read(*known, [&](const Json& json) {
          const Json& config = json.at("config");
          for (const char* key : {"subjects", "retention", "discard", "max_bytes", "duplicate_window"})
            if (config.at(key) != wanted.at(key)) return false;
          return true;
        }).value_or(false);
    if (is_as_wanted) return is_another;
    const Json updated = ask("UPDATE", wanted);
    if (error_code_of(updated) != 0) throw_refused(*connection_, "to change stream '" + options_.name + "'", updated);
    return is_another;
  }
  Json made;
  try {
    made = ask("CREATE", wanted);
  } catch (const BrokerAway&) {  // who may not make it gets no answer
    throw BrokerAway("stream '" + options_.name + "' is not there, and the broker does not answer who would make it",
                     connection_->state().server,
                     "its other end makes it once it runs; what that one says, too, where the broker refuses it");
  }
  if (error_code_of(made) == kNameInUse && patience > kPause) {  // another makes it
    std::this_thread::sleep_for(kPause);
    return ensure(patience - kPause);
  }
  if (error_code_of(made) != 0) throw_refused(*connection_, "to make stream '" + options_.name + "'", made);
  created_ = created(made);
  return true;
}

std::optional<StreamState> NatsStream::state(milliseconds patience) const {
  const auto answer = ask_stream(*connection_, options_.domain, options_.name, patience);
  if (!answer) return std::nullopt;
  return read(*answer, [](const Json& json) {
    const Json& state = json.at("state");
    return StreamState{count_at(state, "messages"), count_at(state, "bytes"), count_at(state, "first_seq"),
                       count_at(state, "last_seq")};
  });
}

void NatsStream::purge(const std::string& subject, std::uint64_t before) const {
  const Json request = {{"filter", subject}, {"seq", before}};
  connection_->publish(api_of(options_.domain, "STREAM.PURGE." + options_.name), request.dump());
}

void NatsStream::remove() const { connection_->publish(api_of(options_.domain, "STREAM.DELETE." + options_.name), ""); }

Publication NatsStream::publish(const std::string& subject, std::string_view bytes, const std::string& message_id,
                                milliseconds patience) const {
  const auto answer = connection_->request(subject, bytes, patience, message_id);
  if (!answer)
    throw Error(ErrorCode::kMissing, "no stream confirms a message to '" + subject + "'", connection_->state().server,
                "see whether the broker runs; publish it again under the same id");
  return publication_of(*answer);
}

NatsConsumer::NatsConsumer(std::shared_ptr<NatsConnection> connection, ConsumerOptions options)
    : connection_(std::move(connection)), options_(std::move(options)) {}

std::string NatsConsumer::api(const std::string& what) const {
  return api_of(options_.domain, what + "." + options_.stream + "." + options_.name);
}

namespace {

Json consumer_request(const ConsumerOptions& options, std::uint64_t from) {
  Json config = {{"durable_name", options.name},
                 {"deliver_policy", from == 0 ? "all" : "by_start_sequence"},
                 {"ack_policy", "explicit"},
                 {"ack_wait", nanoseconds(options.repeat_s)},
                 {"max_deliver", -1},
                 {"filter_subject", options.subject},
                 {"replay_policy", "instant"},
                 {"max_ack_pending", options.most_unacknowledged},
                 {"max_waiting", 16}};
  if (from > 0) config["opt_start_seq"] = from;
  return {{"stream_name", options.stream}, {"config", std::move(config)}};
}

}  // namespace

bool NatsConsumer::ensure(milliseconds patience) {
  const Json known = ask_jetstream(*connection_, api("CONSUMER.INFO"), {}, patience);
  if (error_code_of(known) == 0) {
    const bool is_as_wanted = read(known, [&](const Json& json) {
                                const Json& config = json.at("config");
                                return config.at("filter_subject") == options_.subject &&
                                       config.at("ack_wait") == nanoseconds(options_.repeat_s) &&
                                       config.at("max_ack_pending") == options_.most_unacknowledged;
                              }).value_or(false);
    if (!is_as_wanted) remake(consumer_state(known), patience);
    return false;
  }
  if (const int code = error_code_of(known); code != kConsumerMissing && code != kMissingStream)
    throw_refused(*connection_, "consumer '" + options_.name + "'", known);
  if (!ask_stream(*connection_, options_.domain, options_.stream, patience))
    throw Error(ErrorCode::kMissing, "there is no stream '" + options_.stream + "'", connection_->state().server,
                "its sender makes it; see whether that runs");
  const Json made =
      ask_jetstream(*connection_, api("CONSUMER.DURABLE.CREATE"), consumer_request(options_, 0), patience);
  const int code = error_code_of(made);
  if (code == kConsumerInUse || code == kConsumerExists || code == kDurableDiffers) return false;
  if (code != 0) throw_refused(*connection_, "to make consumer '" + options_.name + "'", made);
  return true;
}

void NatsConsumer::restart(milliseconds patience) {
  if (!ensure(patience)) remake(state(patience), patience);
}

void NatsConsumer::remake(const std::optional<ConsumerState>& before, milliseconds patience) {
  if (before) ask_jetstream(*connection_, api("CONSUMER.DELETE"), {}, patience);
  const Json made = ask_jetstream(*connection_, api("CONSUMER.DURABLE.CREATE"),
                                  consumer_request(options_, before ? before->acknowledged + 1 : 0), patience);
  if (error_code_of(made) != 0) throw_refused(*connection_, "to make consumer '" + options_.name + "' again", made);
}

std::optional<ConsumerState> NatsConsumer::state(milliseconds patience) const {
  return consumer_state(ask_jetstream(*connection_, api("CONSUMER.INFO"), {}, patience));
}

bool NatsConsumer::pull(const std::string& inbox, int messages, double within_s) const {
  const Json request = {{"batch", messages}, {"expires", nanoseconds(within_s)}};
  return connection_->publish(api("CONSUMER.MSG.NEXT"), request.dump(), inbox);
}

bool NatsConsumer::ask_state(const std::string& inbox) const {
  return connection_->publish(api("CONSUMER.INFO"), "", inbox);
}

std::string nats_token(std::string_view name) {
  std::string token;
  for (const char letter : name) {
    const bool is_plain = (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                          (letter >= '0' && letter <= '9') || letter == '_' || letter == '-';
    if (is_plain)
      token += letter;
    else
      token += "=" + to_hex(std::string_view(&letter, 1));
  }
  return token.empty() ? "=" : token;
}

}  // namespace mapweave::transport
