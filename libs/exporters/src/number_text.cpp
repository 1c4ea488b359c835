#include "number_text.h"

#include <algorithm>
#include <charconv>

namespace mapweave::exporters {

void append_fixed(std::string& text, double value, int decimals) {
  char digits[400];  // the largest double has 309 before the point
  const auto end = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed, decimals).ptr;
  const bool minus_zero = digits[0] == '-' && std::all_of(digits + 1, end, [](char c) { return c == '0' || c == '.'; });
  text.append(digits + (minus_zero ? 1 : 0), end);
}

void append_shortest(std::string& text, double value) {
  char digits[40];
  const auto end = std::to_chars(digits, digits + sizeof digits, value == 0.0 ? 0.0 : value).ptr;
  text.append(digits, end);
}

}  // namespace mapweave::exporters
