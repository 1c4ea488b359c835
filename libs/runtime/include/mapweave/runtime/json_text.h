#pragma once
// JSON as text of two spaces a level.

#include <nlohmann/json.hpp>

#include <string>

namespace mapweave::runtime {

// Names of files may be of any bytes: what is no UTF-8 becomes U+FFFD, the replacement character.
inline std::string json_text(const nlohmann::ordered_json& json, int indent = 2) {
  return json.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace mapweave::runtime
