#include "ros1_topics.h"

#include <mapweave/core/error.h>

#include <algorithm>

namespace mapweave::rawlog::ros {

void Ros1Topics::add(const Ros1Record& record) {
  const auto described = parse_ros1_fields(record.data);
  if (!described || !record.fields.connection || record.fields.topic.empty() || described->type.empty())
    throw Error(ErrorCode::kCorrupt, "a connection cannot be decoded");
  const std::uint32_t connection = *record.fields.connection;
  const std::string name(record.fields.topic), type(described->type);
  if (const auto known = topic_of(connection)) {
    const BagTopic& topic = topics_[*known];
    if (topic.name != name || topic.type != type)
      throw Error(ErrorCode::kCorrupt, "connection " + std::to_string(connection) + " is '" + name + "' of type " +
                                           type + " here and '" + topic.name + "' of type " + topic.type +
                                           " elsewhere");
    return;
  }
  auto topic = std::find_if(topics_.begin(), topics_.end(),
                            [&](const BagTopic& one) { return one.name == name && one.type == type; });
  if (topic == topics_.end()) topic = topics_.insert(topic, {name, type, MessageEncoding::ros1, 0});
  connections_[connection] = static_cast<std::size_t>(topic - topics_.begin());
}

std::optional<std::size_t> Ros1Topics::topic_of(std::uint32_t connection) const {
  const auto known = connections_.find(connection);
  return known == connections_.end() ? std::nullopt : std::optional(known->second);
}

bool Ros1Topics::add_index(std::string_view index) {
  Ros1Topics found;
  try {
    while (!index.empty()) {
      const auto record = take_ros1_record(index);
      if (!record || !record->fields.op) return false;
      if (*record->fields.op == static_cast<std::uint8_t>(Ros1Op::connection))
        found.add(*record);
      else if (*record->fields.op != static_cast<std::uint8_t>(Ros1Op::chunk_info) || !found.add_counts(record->data))
        return false;
    }
  } catch (const Error&) {
    return false;
  }
  *this = std::move(found);
  return true;
}

bool Ros1Topics::add_counts(std::string_view chunk_info) {
  for (; chunk_info.size() >= 8; chunk_info.remove_prefix(8)) {
    const auto topic = topic_of(read_u32(chunk_info.data()));
    if (!topic) return false;
    topics_[*topic].messages += read_u32(chunk_info.data() + 4);
  }
  return chunk_info.empty();
}

}  // namespace mapweave::rawlog::ros
