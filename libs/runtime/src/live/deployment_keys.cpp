#include "record_json.h"

#include <mapweave/core/files.h>
#include <mapweave/runtime/deployment_keys.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/transport/nats_stream.h>

namespace mapweave::runtime {

std::string encode(const ProgramKeys& keys) {
  nlohmann::ordered_json json;
  json["user"] = keys.user;
  json["password"] = keys.password;
  json["authority"] = keys.authority;
  return json_text(json) + "\n";
}

ProgramKeys read_program_keys(const std::filesystem::path& file) {
  constexpr std::size_t kMostBytes = std::size_t{1} << 20;
  const std::string where = file.string();
  const nlohmann::json json = scheduling::parse_json(read_file(file, kMostBytes), where);
  if (!json.is_object()) scheduling::refuse("keys of a program were expected", where, "", "");
  const auto text = [&](const char* key) { return text_of(scheduling::member(json, key, where, ""), where, key); };
  return {text("user"), text("password"), text("authority")};
}

std::string inbox_of(const std::string& user) { return "_INBOX_" + transport::nats_token(user); }

}  // namespace mapweave::runtime
