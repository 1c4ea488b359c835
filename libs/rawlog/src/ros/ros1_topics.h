#pragma once
// The connections of a ROS 1 bag, as topics: several publishers of one topic have a connection each.

#include "bag_reader.h"
#include "ros1_records.h"

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::rawlog::ros {

class Ros1Topics {
 public:
  // A connection's record. Throws Error kCorrupt without a place.
  void add(const Ros1Record& record);
  // All connections and numbers of messages of an index. False, and nothing is kept, where it makes no sense.
  bool add_index(std::string_view index);
  void count_message(std::size_t topic) { ++topics_[topic].messages; }

  std::optional<std::size_t> topic_of(std::uint32_t connection) const;
  const std::vector<BagTopic>& topics() const { return topics_; }

 private:
  bool add_counts(std::string_view chunk_info);

  std::vector<BagTopic> topics_;
  std::map<std::uint32_t, std::size_t> connections_;  // indices of topics
};

}  // namespace mapweave::rawlog::ros
