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

}  // namespace mapweave::mcap
