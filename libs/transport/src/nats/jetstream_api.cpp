#include "jetstream_api.h"

#include <mapweave/core/error.h>

namespace mapweave::transport {

using Json = nlohmann::json;

int error_code_of(const Json& answer) {
  if (!answer.is_object() || !answer.contains("error") || !answer["error"].is_object()) return 0;
  return answer["error"].value("err_code", answer["error"].value("code", 1));
}

Json ask_jetstream(NatsConnection& connection, const std::string& subject, const Json& request,
                   std::chrono::milliseconds patience) {
  const auto answer = connection.request(subject, request.is_null() ? "" : request.dump(), patience);
  const std::string server = connection.state().server;
  if (!answer)
    throw Error(ErrorCode::kMissing, "the broker does not answer '" + subject + "'", server,
                "see whether the broker runs, and what this user may publish and receive");
  if (answer->status == 503)
    throw Error(ErrorCode::kUnsupported,
                "the broker has no JetStream, or none is connected that answers '" + subject + "'", server,
                "start nats-server with -js, or with 'jetstream' in its configuration");
  Json json = Json::parse(answer->bytes, nullptr, false);
  if (!json.is_object())
    throw Error(ErrorCode::kCorrupt, "the broker's answer to '" + subject + "' is not JSON", server,
                "use nats-server 2.9 or newer");
  return json;
}

}  // namespace mapweave::transport
