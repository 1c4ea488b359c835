#include "ros_messages.h"

#include <nlohmann/json.hpp>

#include <algorithm>

namespace mapweave::ros_nodes {
namespace {

using Json = nlohmann::ordered_json;
using diagnostic_msgs::DiagnosticStatus;

// Empty where there is no such text.
std::string text_of(const Json& json, const char* key) {
  const auto found = json.is_object() ? json.find(key) : json.end();
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

const Json& part_of(const Json& json, const char* key) {
  static const Json kNothing;
  const auto found = json.is_object() ? json.find(key) : json.end();
  return found != json.end() ? *found : kNothing;
}

void add_value(DiagnosticStatus& status, const std::string& key, const Json& value) {
  diagnostic_msgs::KeyValue pair;
  pair.key = key;
  pair.value =
      value.is_string() ? value.get<std::string>() : value.dump(-1, ' ', false, Json::error_handler_t::replace);
  status.values.push_back(std::move(pair));
}

void add_counts(DiagnosticStatus& status, const std::string& prefix, const Json& counts) {
  if (counts.is_object())
    for (const auto& [name, number] : counts.items()) add_value(status, prefix + name, number);
}

void add_link(DiagnosticStatus& status, const Json& link) {
  const std::string prefix = text_of(link, "role") + " " + text_of(link, "name") + ": ";
  for (const char* key : {"is_on_wire", "is_needed", "silent_seconds"})
    if (link.is_object() && link.contains(key)) add_value(status, prefix + key, link[key]);
  add_counts(status, prefix, part_of(link, "counts"));
}

// An error goes before what was found earlier.
void add_finding(DiagnosticStatus& status, const Json& finding) {
  const std::string level = text_of(finding, "level"), what = text_of(finding, "what");
  const auto severity = static_cast<std::int8_t>(level == "error" ? DiagnosticStatus::ERROR : DiagnosticStatus::WARN);
  if (severity > status.level) {
    status.level = severity;
    status.message = what;
  }
  add_value(status, level, what + "; " + text_of(finding, "remedy"));
}

DiagnosticStatus status_of(const Json& tier) {
  DiagnosticStatus status;
  const std::string role = text_of(tier, "role"), name = text_of(tier, "name");
  status.name = "mapweave: " + role + (name == role ? "" : " " + name);
  status.message = text_of(tier, "state");
  if (role.empty() || status.message.empty()) {
    status.level = DiagnosticStatus::STALE;
    status.message = "what it says of itself cannot be read";
    return status;
  }
  status.level = DiagnosticStatus::OK;
  add_value(status, "state", status.message);
  add_counts(status, "", part_of(tier, "counts"));
  for (const Json& link : part_of(tier, "links")) add_link(status, link);
  for (const Json& finding : part_of(tier, "findings")) add_finding(status, finding);
  return status;
}

}  // namespace

diagnostic_msgs::DiagnosticArray diagnostics_message(const Json& status) {
  diagnostic_msgs::DiagnosticArray message;
  const Json& tiers = part_of(status, "tiers");
  if (tiers.is_array())
    for (const Json& tier : tiers) message.status.push_back(status_of(tier));
  if (message.status.empty()) {
    DiagnosticStatus& silent = message.status.emplace_back();
    silent.level = DiagnosticStatus::STALE;
    silent.name = "mapweave: program";
    silent.message = "it says nothing of itself";
  }
  for (DiagnosticStatus& one : message.status) one.hardware_id = text_of(status, "name");
  return message;
}

}  // namespace mapweave::ros_nodes
