#pragma once
// The records that ROS 1 bags are made of: http://wiki.ros.org/Bags/Format/2.0

#include <cstdint>
#include <optional>
#include <string_view>

namespace mapweave::rawlog::ros {

enum class Ros1Op : std::uint8_t {
  message = 0x02,
  bag_header = 0x03,
  index_data = 0x04,
  chunk = 0x05,
  chunk_info = 0x06,
  connection = 0x07
};

// The fields of a record's header, or of a connection's description. Views into the bytes that were parsed.
struct Ros1Fields {
  std::optional<std::uint8_t> op;
  std::optional<std::uint32_t> connection, size, count;
  std::optional<std::uint64_t> index_position;
  std::optional<std::int64_t> time_ns;
  std::string_view topic, type, compression, encryptor;
};

std::uint32_t read_u32(const char* from);

// Reads fields ("name=value", each after its length). Nullopt where they do not fit the bytes, or have a wrong size.
std::optional<Ros1Fields> parse_ros1_fields(std::string_view bytes);

struct Ros1Record {
  Ros1Fields fields;
  std::string_view data;
};

// Takes the next record off the front of `bytes`. Nullopt, and `bytes` unchanged, where no whole record is there.
std::optional<Ros1Record> take_ros1_record(std::string_view& bytes);

}  // namespace mapweave::rawlog::ros
