#pragma once
// Bulk numbers as bytes, the lower byte first, one after the other.

#include <mapweave/maps/keyframe.h>

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

// The fields u, v, inverse_depth (16 bits each) and level (8) of a point in a picture.
inline constexpr std::size_t kPictureBytes = 7;
template <class Point>
void append_picture_point(std::string& bytes, const Point& point) {
  for (const std::uint16_t number : {point.u, point.v, point.inverse_depth}) {
    bytes.push_back(static_cast<char>(number & 0xff));
    bytes.push_back(static_cast<char>(number >> 8));
  }
  bytes.push_back(static_cast<char>(point.level));
}
template <class Point>
void take_picture_point(Point& point, std::string_view bytes) {
  const auto number = [&](std::size_t at) {
    return static_cast<std::uint16_t>(static_cast<std::uint8_t>(bytes[at]) | static_cast<std::uint8_t>(bytes[at + 1])
                                                                                 << 8);
  };
  point.u = number(0);
  point.v = number(2);
  point.inverse_depth = number(4);
  point.level = static_cast<std::uint8_t>(bytes[6]);
}

inline constexpr std::size_t kPointBytes = kPictureBytes + 1;
inline std::string packed(const std::vector<KeyframePoint>& points) {
  std::string bytes;
  bytes.reserve(kPointBytes * points.size());
  for (const KeyframePoint& point : points) {
    append_picture_point(bytes, point);
    bytes.push_back(static_cast<char>(point.angle));
  }
  return bytes;
}
inline std::vector<KeyframePoint> unpacked_points(std::string_view bytes) {
  std::vector<KeyframePoint> points(bytes.size() / kPointBytes);
  for (std::size_t i = 0; i < points.size(); ++i) {
    take_picture_point(points[i], bytes.substr(kPointBytes * i, kPictureBytes));
    points[i].angle = static_cast<std::uint8_t>(bytes[kPointBytes * i + kPictureBytes]);
  }
  return points;
}

inline constexpr std::size_t kDescriptorBytes = 32;
inline std::string packed(const std::vector<BinaryDescriptor>& descriptors) {
  std::string bytes;
  bytes.reserve(kDescriptorBytes * descriptors.size());
  for (const BinaryDescriptor& descriptor : descriptors)
    for (const std::uint64_t word : descriptor)
      for (int shift = 0; shift < 64; shift += 8) bytes.push_back(static_cast<char>(word >> shift & 0xff));
  return bytes;
}
inline std::vector<BinaryDescriptor> unpacked_descriptors(std::string_view bytes) {
  std::vector<BinaryDescriptor> descriptors(bytes.size() / kDescriptorBytes, BinaryDescriptor{});
  for (std::size_t i = 0; i < kDescriptorBytes * descriptors.size(); ++i)
    descriptors[i / 32][i / 8 % 4] |= std::uint64_t{static_cast<std::uint8_t>(bytes[i])} << (8 * (i % 8));
  return descriptors;
}

}  // namespace mapweave
