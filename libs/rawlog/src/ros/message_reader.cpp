#include "message_reader.h"

#include <string>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::size_t kEncapsulationBytes = 4;
constexpr std::int64_t kNanoseconds = 1'000'000'000;
constexpr const char* kRecordAgain = "record again, or leave this topic out";

}  // namespace

MessageReader::MessageReader(const std::byte* data, std::size_t size, MessageEncoding encoding, const char* what)
    : data_(data), size_(size), encoding_(encoding), what_(what) {
  if (encoding == MessageEncoding::ros1) return;
  if (size < kEncapsulationBytes)
    throw Error(ErrorCode::kCorrupt,
                "the message has " + std::to_string(size) + " bytes; CDR begins with 4 that say its byte order", {},
                kRecordAgain);
  const unsigned form =
      std::to_integer<unsigned>(data[0]) << 8 | std::to_integer<unsigned>(data[1]);  // then two bytes of options
  if (form > 1)
    throw Error(
        ErrorCode::kUnsupported,
        "the message is of CDR form " + std::to_string(form) + "; plain CDR of version 1 (forms 0 and 1) was expected",
        {}, "record with a middleware that writes plain CDR, as rmw_fastrtps and rmw_cyclonedds do");
  swapped_ = form == 0;
  position_ = start_ = kEncapsulationBytes;
}

std::string_view MessageReader::string() {
  const std::string_view all = bytes();
  if (encoding_ == MessageEncoding::ros1 || all.empty()) return all;
  if (all.back() != '\0')
    throw Error(ErrorCode::kCorrupt,
                "the text that ends at byte " + std::to_string(position_) + " of the message does not end with NUL", {},
                kRecordAgain);
  return all.substr(0, all.size() - 1);
}

std::size_t MessageReader::count(std::size_t least_bytes) {
  const std::size_t length = read<std::uint32_t>();
  if (least_bytes > 0 && length > left() / least_bytes) fail_early(length, least_bytes);
  return length;
}

std::string_view MessageReader::bytes() {
  const std::size_t length = count(1);
  if (length == 0) return {};
  return {reinterpret_cast<const char*>(taken(length)), length};
}

std::int64_t MessageReader::time_ns() {
  if (encoding_ == MessageEncoding::cdr) return duration_ns();
  const std::int64_t seconds = read<std::uint32_t>();
  return seconds * kNanoseconds + read<std::uint32_t>();
}

std::int64_t MessageReader::duration_ns() {
  const std::int64_t seconds = read<std::int32_t>();
  if (encoding_ == MessageEncoding::cdr) return seconds * kNanoseconds + read<std::uint32_t>();
  return seconds * kNanoseconds + read<std::int32_t>();
}

MessageHeader MessageReader::header() {
  if (encoding_ == MessageEncoding::ros1) skip<std::uint32_t>();
  MessageHeader header;
  header.stamp_ns = time_ns();
  header.frame_id = string();
  return header;
}

void MessageReader::fail_early(std::size_t length, std::size_t size) const {
  const std::string wanted =
      length == 1 ? std::to_string(size) + " bytes are"
                  : std::to_string(length) + " elements of " + std::to_string(size) + " bytes or more are";
  throw Error(ErrorCode::kCorrupt,
              std::string("the ") + what_ + " ends early: " + wanted + " expected at byte " +
                  std::to_string(position_) + " of it, and " + std::to_string(left()) + " bytes are left",
              {}, kRecordAgain);
}

Error placed(const Error& error, const std::string& where) {
  return Error(error.code(), error.problem(), where, error.remedy());
}

}  // namespace mapweave::rawlog::ros
