#pragma once
// Numbers as files of other programs hold them: the lowest byte first.

#include <cstring>
#include <string>
#include <type_traits>

namespace mapweave {

template <class Number>
void append_number(std::string& bytes, Number number) {
  static_assert(std::is_arithmetic_v<Number>);
  char raw[sizeof(Number)];
  std::memcpy(raw, &number, sizeof number);  // processors of Debian's ports that this builds for are little-endian
  bytes.append(raw, sizeof raw);
}

}  // namespace mapweave
