#pragma once
// Numbers as files of other programs hold them: the lowest byte first.

#include <mapweave/core/error.h>

#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

namespace mapweave {

template <class Number>
void append_number(std::string& bytes, Number number) {
  static_assert(std::is_arithmetic_v<Number>);
  char raw[sizeof(Number)];
  std::memcpy(raw, &number, sizeof number);  // processors of Debian's ports that this builds for are little-endian
  bytes.append(raw, sizeof raw);
}

// Contract: it lies within the bytes.
template <class Number>
Number number_at(std::string_view bytes, std::size_t offset) {
  static_assert(std::is_arithmetic_v<Number>);
  MAPWEAVE_EXPECT(bytes.size() >= sizeof(Number) && offset <= bytes.size() - sizeof(Number),
                  "a number lies beyond the bytes");
  Number number;
  std::memcpy(&number, bytes.data() + offset, sizeof number);
  return number;
}

}  // namespace mapweave
