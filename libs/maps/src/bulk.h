#pragma once
// Bulk numbers as bytes: 16 bits each, the lower byte first, one after the other.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

template <class Number>
std::string packed(const std::vector<Number>& numbers) {
  static_assert(sizeof(Number) == 2);
  std::string bytes(numbers.size() * 2, '\0');
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto bits = static_cast<std::uint16_t>(numbers[i]);
    bytes[2 * i] = static_cast<char>(bits & 0xff);
    bytes[2 * i + 1] = static_cast<char>(bits >> 8);
  }
  return bytes;
}

// An odd last byte is left out: callers compare the size.
template <class Number>
std::vector<Number> unpacked(std::string_view bytes) {
  static_assert(sizeof(Number) == 2);
  std::vector<Number> numbers(bytes.size() / 2);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto low = static_cast<std::uint8_t>(bytes[2 * i]), high = static_cast<std::uint8_t>(bytes[2 * i + 1]);
    numbers[i] = static_cast<Number>(static_cast<std::uint16_t>(low | high << 8));
  }
  return numbers;
}

}  // namespace mapweave
