#pragma once
// The fields of a serialized ROS message, one after the other.
// ROS 1: packed, little-endian (wiki.ros.org/msg). ROS 2: plain CDR, version 1 (OMG DDS-XTypes 1.3, 7.4.1): four bytes
// say the byte order, then each field stands at a multiple of its size, counted from after those four.

#include "bag_reader.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace mapweave::rawlog::ros {

struct MessageHeader {
  std::int64_t stamp_ns = 0;  // since 1970
  std::string_view frame_id;
};

// Nothing is read, and no memory is asked for, beyond the message's bytes: Error kCorrupt says at which byte of the
// message what was expected; the caller adds where the message is (placed()). The bytes must outlive the reader and
// what string() and bytes() answer. Records of bags are written as ROS 1's messages are.
class MessageReader {
 public:
  // Throws Error: kCorrupt for CDR without its first four bytes, kUnsupported for other forms of CDR.
  // `what` it is that is read: for errors.
  MessageReader(const std::byte* data, std::size_t size, MessageEncoding encoding, const char* what = "message");
  MessageReader(const std::vector<std::byte>& data, MessageEncoding encoding)
      : MessageReader(data.data(), data.size(), encoding) {}

  // A number; a bool is one byte, true where it is not 0.
  template <class T>
  T read() {
    static_assert(std::is_arithmetic_v<T>);
    if constexpr (std::is_same_v<T, bool>) {
      return read<std::uint8_t>() != 0;
    } else {
      align(sizeof(T));
      return loaded<T>(taken(sizeof(T)));
    }
  }

  std::string_view string();  // without the NUL that ends it in CDR
  // The length of a sequence that follows. Throws where fewer than so many elements of `least_bytes` each are left.
  std::size_t count(std::size_t least_bytes = 1);

  // A sequence of numbers: its length, then the numbers. `numbers` is replaced.
  template <class T>
  void sequence(std::vector<T>& numbers) {
    static_assert(std::is_arithmetic_v<T> && !std::is_same_v<T, bool>);
    const std::size_t length = count(sizeof(T));
    numbers.resize(length);
    read_numbers(numbers.data(), length);
  }
  template <class T>
  std::vector<T> sequence() {
    std::vector<T> numbers;
    sequence(numbers);
    return numbers;
  }
  std::string_view bytes();  // a sequence of bytes, where it stands

  // An array of fixed length, such as a covariance of 36 numbers.
  template <class T, std::size_t kLength>
  std::array<T, kLength> array() {
    static_assert(std::is_arithmetic_v<T> && !std::is_same_v<T, bool>);
    std::array<T, kLength> numbers;
    read_numbers(numbers.data(), kLength);
    return numbers;
  }

  template <class T>
  void skip(std::size_t length = 1) {
    if (length == 0) return;
    align(sizeof(T));
    if (length > left() / sizeof(T)) fail_early(length, sizeof(T));
    position_ += length * sizeof(T);
  }
  template <class T>
  void skip_sequence() {
    skip<T>(count(sizeof(T)));
  }
  void skip_string() { string(); }

  // A time or a duration: seconds and nanoseconds, of 32 bits each. ROS 1's times have no sign.
  std::int64_t time_ns();
  std::int64_t duration_ns();
  // A std_msgs/Header; the number `seq` that ROS 1 has in it is skipped.
  MessageHeader header();

  std::size_t position() const { return position_; }  // in bytes of the message
  std::size_t left() const { return size_ - position_; }

 private:
  void align(std::size_t size) {
    if (encoding_ == MessageEncoding::ros1 || size < 2) return;
    const std::size_t beyond = (position_ - start_) % size;
    if (beyond != 0) position_ = std::min(size_, position_ + size - beyond);
  }
  const std::byte* taken(std::size_t size) {
    if (size > left()) fail_early(1, size);
    const std::byte* place = data_ + position_;
    position_ += size;
    return place;
  }
  template <class T>
  T loaded(const std::byte* place) const {
    std::array<std::byte, sizeof(T)> raw;
    std::memcpy(raw.data(), place, sizeof(T));
    if (swapped_) std::reverse(raw.begin(), raw.end());
    T number;
    std::memcpy(&number, raw.data(), sizeof(T));
    return number;
  }
  template <class T>
  void read_numbers(T* numbers, std::size_t length) {
    if (length == 0) return;
    align(sizeof(T));
    if (length > left() / sizeof(T)) fail_early(length, sizeof(T));
    const std::byte* place = taken(length * sizeof(T));
    if (swapped_)
      for (std::size_t i = 0; i < length; ++i) numbers[i] = loaded<T>(place + i * sizeof(T));
    else
      std::memcpy(numbers, place, length * sizeof(T));
  }
  [[noreturn]] void fail_early(std::size_t length, std::size_t size) const;

  const std::byte* data_;
  std::size_t size_, position_ = 0, start_ = 0;  // start_: from where alignment counts
  MessageEncoding encoding_;
  const char* what_;
  bool swapped_ = false;  // the numbers' bytes, against this processor's order (little-endian)
};

// The same error with the place that it lacks.
Error placed(const Error& error, const std::string& where);

}  // namespace mapweave::rawlog::ros
