#pragma once
// How an MCAP file is written (mcap.dev/spec, version 0): records of an opcode of one byte, a length of eight and
// fields, numbers little-endian.

#include <mapweave/core/little_endian.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace mapweave::mcap {

constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};

enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0b,
  kDataEnd = 0x0f,
};

inline void append_text(std::string& to, std::string_view text) {
  append_number(to, static_cast<std::uint32_t>(text.size()));
  to += text;
}

inline void append_record(std::string& to, Opcode opcode, std::string_view fields) {
  to += static_cast<char>(opcode);
  append_number(to, static_cast<std::uint64_t>(fields.size()));
  to += fields;
}

inline void append_header(std::string& to, std::string_view profile, std::string_view library) {
  std::string fields;
  append_text(fields, profile);
  append_text(fields, library);
  append_record(to, Opcode::kHeader, fields);
}

inline void append_schema(std::string& to, std::uint16_t number, std::string_view type, std::string_view encoding,
                          std::string_view definition) {
  std::string fields;
  append_number(fields, number);
  append_text(fields, type);
  append_text(fields, encoding);
  append_text(fields, definition);
  append_record(to, Opcode::kSchema, fields);
}

// metadata: pairs of texts.
inline void append_channel(std::string& to, std::uint16_t number, std::uint16_t schema, std::string_view topic,
                           std::string_view encoding, std::string_view metadata) {
  std::string fields;
  append_number(fields, number);
  append_number(fields, schema);
  append_text(fields, topic);
  append_text(fields, encoding);
  append_text(fields, metadata);
  append_record(to, Opcode::kChannel, fields);
}

// The end of the data; their checksum is left out.
inline void append_data_end(std::string& to) {
  append_record(to, Opcode::kDataEnd, std::string(sizeof(std::uint32_t), '\0'));
}

}  // namespace mapweave::mcap
