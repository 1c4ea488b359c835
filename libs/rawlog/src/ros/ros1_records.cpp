#include "ros1_records.h"

namespace mapweave::rawlog::ros {
namespace {

std::uint64_t read_little_endian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[i]);
  return value;
}

template <class Int>
bool read_number(std::string_view value, std::optional<Int>& to) {
  if (value.size() != sizeof(Int)) return false;
  to = static_cast<Int>(read_little_endian(value));
  return true;
}

bool read_time(std::string_view value, std::optional<std::int64_t>& to) {
  if (value.size() != 8) return false;
  const auto seconds = static_cast<std::int64_t>(read_little_endian(value.substr(0, 4)));
  to = seconds * 1'000'000'000 + static_cast<std::int64_t>(read_little_endian(value.substr(4)));
  return true;
}

// False where a known field has a wrong size; unknown fields are passed over.
bool read_field(std::string_view name, std::string_view value, Ros1Fields& fields) {
  if (name == "op") return read_number(value, fields.op);
  if (name == "conn") return read_number(value, fields.connection);
  if (name == "size") return read_number(value, fields.size);
  if (name == "count") return read_number(value, fields.count);
  if (name == "index_pos") return read_number(value, fields.index_position);
  if (name == "time") return read_time(value, fields.time_ns);
  if (name == "topic") fields.topic = value;
  if (name == "type") fields.type = value;
  if (name == "compression") fields.compression = value;
  if (name == "encryptor") fields.encryptor = value;
  return true;
}

}  // namespace

std::uint32_t read_u32(const char* from) { return static_cast<std::uint32_t>(read_little_endian({from, 4})); }

std::optional<Ros1Fields> parse_ros1_fields(std::string_view bytes) {
  Ros1Fields fields;
  while (!bytes.empty()) {
    if (bytes.size() < 4) return std::nullopt;
    const std::size_t length = read_u32(bytes.data());
    bytes.remove_prefix(4);
    if (length > bytes.size()) return std::nullopt;
    const std::string_view field = bytes.substr(0, length);
    bytes.remove_prefix(length);
    const std::size_t equals = field.find('=');
    if (equals == std::string_view::npos || !read_field(field.substr(0, equals), field.substr(equals + 1), fields))
      return std::nullopt;
  }
  return fields;
}

std::optional<Ros1Record> take_ros1_record(std::string_view& bytes) {
  if (bytes.size() < 4) return std::nullopt;
  const std::size_t header = read_u32(bytes.data());
  if (header > bytes.size() - 4 || bytes.size() - 4 - header < 4) return std::nullopt;
  const std::size_t data = read_u32(bytes.data() + 4 + header);
  if (data > bytes.size() - 8 - header) return std::nullopt;
  const auto fields = parse_ros1_fields(bytes.substr(4, header));
  if (!fields) return std::nullopt;
  const Ros1Record record{*fields, bytes.substr(8 + header, data)};
  bytes.remove_prefix(8 + header + data);
  return record;
}

}  // namespace mapweave::rawlog::ros
