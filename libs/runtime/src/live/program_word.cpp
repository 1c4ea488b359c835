#include "program_word.h"

#include "record_json.h"

#include <charconv>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::json;

constexpr double kMostCount = 1e15;

// 0 where it is not said.
double count_of(const Json& counts, const char* name, const std::string& where) {
  const auto found = counts.find(name);
  return found == counts.end() ? 0.0 : scheduling::number(*found, 0.0, kMostCount, false, where, name);
}

const Json& object_of(const Json& value, const std::string& where, const std::string& key) {
  if (!value.is_object()) scheduling::refuse("an object was expected", where, key, "");
  return value;
}

bool is_true(const Json& object, const char* name) {
  const auto found = object.find(name);
  return found != object.end() && found->is_boolean() && found->get<bool>();
}

ProgramWord::Link link_of(const Json& json, const std::string& where) {
  const Json& object = object_of(json, where, "links");
  const Json& counts = object_of(scheduling::member(object, "counts", where, "links"), where, "counts");
  ProgramWord::Link link;
  link.name = text_of(scheduling::member(object, "name", where, "links"), where, "name");
  link.scans = count_of(counts, "scans", where);
  link.queue_bytes = count_of(counts, "queue_bytes", where);
  if (const double measured = count_of(counts, "bytes_per_second", where); measured > 0.0) link.bytes_per_s = measured;
  return link;
}

}  // namespace

ProgramWord decode_program_word(std::string_view text, const std::string& where) {
  const Json json = scheduling::parse_json(text, where);
  const Json& tiers = list_of(scheduling::member(object_of(json, where, ""), "tiers", where, ""), where, "tiers");
  if (tiers.empty()) scheduling::refuse("a tier was expected", where, "tiers", "");
  const Json& tier = object_of(tiers.front(), where, "tiers");
  const Json& counts = object_of(scheduling::member(tier, "counts", where, "tiers"), where, "counts");
  ProgramWord word;
  word.said_at_ns = whole_number_of(scheduling::member(json, "said_at_ns", where, ""), where, "said_at_ns");
  word.is_done = is_true(tier, "is_done");
  word.is_sealing = is_true(tier, "is_sealing");
  word.plan = static_cast<std::uint64_t>(count_of(counts, "plan", where));
  word.scans = count_of(counts, "scans", where);
  word.mapping_s = count_of(counts, "mapping_seconds", where);
  for (const Json& link : list_of(scheduling::member(tier, "links", where, "tiers"), where, "links"))
    word.links.push_back(link_of(link, where));
  if (const auto ended = tier.find("ended"); ended != tier.end())
    for (std::string& robot : texts_of(*ended, where, "ended")) word.ended.insert(std::move(robot));
  return word;
}

std::string packed(const std::vector<std::string>& messages, std::size_t most_bytes) {
  std::string bytes;
  for (const std::string& message : messages) {
    const std::string size = std::to_string(message.size()) + "\n";
    if (bytes.size() + size.size() + message.size() <= most_bytes) bytes += size + message;
  }
  return bytes;
}

std::vector<std::string> unpacked(std::string_view bytes, const std::string& where) {
  std::vector<std::string> messages;
  while (!bytes.empty()) {
    std::size_t size = 0;
    const auto [end, problem] = std::from_chars(bytes.data(), bytes.data() + bytes.size(), size);
    const auto digits = static_cast<std::size_t>(end - bytes.data());
    if (problem != std::errc() || digits == bytes.size() || *end != '\n' || size > bytes.size() - digits - 1)
      throw Error(ErrorCode::kCorrupt, "messages without their sizes", where, "give all programs the same version");
    messages.emplace_back(bytes.substr(digits + 1, size));
    bytes.remove_prefix(digits + 1 + size);
  }
  return messages;
}

}  // namespace mapweave::runtime
