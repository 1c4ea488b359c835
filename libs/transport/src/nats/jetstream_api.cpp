#include "jetstream_api.h"

#include <mapweave/core/error.h>

namespace mapweave::transport {

using Json = nlohmann::json;

namespace {

constexpr char kNeverMade[] = "0001-01-01T";  // how Go writes a time that was never set

}  // namespace

std::string api_of(const std::string& domain, const std::string& what) {
  return (domain.empty() ? "$JS.API." : "$JS." + domain + ".API.") + what;
}

int error_code_of(const Json& answer) {
  if (!answer.is_object() || !answer.contains("error") || !answer["error"].is_object()) return 0;
  for (const char* key : {"err_code", "code"})
    if (const auto code = answer["error"].find(key); code != answer["error"].end() && code->is_number_integer())
      if (const int number = code->get<int>(); number != 0) return number;
  return 1;
}

std::string error_text_of(const Json& answer) {
  const std::string number = "error " + std::to_string(error_code_of(answer));
  if (!answer.is_object() || !answer.contains("error") || !answer["error"].is_object()) return number;
  const auto text = answer["error"].find("description");
  return text != answer["error"].end() && text->is_string() ? text->get<std::string>() : number;
}

void throw_refused(NatsConnection& connection, const std::string& what, const Json& answer) {
  throw Error(ErrorCode::kBadInput, "the broker refuses " + what + ": " + error_text_of(answer),
              connection.state().server, "see the broker's configuration and what else uses these names");
}

Json ask_jetstream(NatsConnection& connection, const std::string& subject, const Json& request,
                   std::chrono::milliseconds patience) {
  const auto answer = connection.request(subject, request.is_null() ? "" : request.dump(), patience);
  const std::string server = connection.state().server;
  if (!answer)
    throw BrokerAway("the broker does not answer '" + subject + "'", server,
                     "see whether the broker runs, and what this user may publish and receive");
  if (answer->status == 503)
    throw BrokerAway("the broker has no JetStream, or none is connected that answers '" + subject + "'", server,
                     "start nats-server with -js, or with 'jetstream' in its configuration");
  Json json = Json::parse(answer->bytes, nullptr, false);
  if (!json.is_object())
    throw Error(ErrorCode::kCorrupt, "the broker's answer to '" + subject + "' is not JSON", server,
                "use nats-server 2.9 or newer");
  return json;
}

std::optional<Json> ask_stream(NatsConnection& connection, const std::string& domain, const std::string& stream,
                               std::chrono::milliseconds patience) {
  Json answer = ask_jetstream(connection, api_of(domain, "STREAM.INFO." + stream), {}, patience);
  if (error_code_of(answer) == kMissingStream) return std::nullopt;
  if (error_code_of(answer) != 0) throw_refused(connection, "stream '" + stream + "'", answer);
  if (const auto created = answer.find("created"); created != answer.end() && created->is_string() &&
                                                   created->get_ref<const std::string&>().rfind(kNeverMade, 0) == 0)
    return std::nullopt;
  return answer;
}

}  // namespace mapweave::transport
