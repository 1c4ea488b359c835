// The fields of serialized messages: bytes that the Python package rosbags wrote, and damage of each kind.

#include "logs.h"

#include <ros/message_reader.h>

#include <cmath>
#include <limits>

namespace mapweave::rawlog::ros {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::byte> from_hex(const std::string& digits) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoul(digits.substr(i, 2), nullptr, 16)));
  return bytes;
}

// The same sensor_msgs/LaserScan in three forms, by rosbags 0.11.9.
const std::vector<std::byte> kRos1Scan = from_hex(
    "0700000000f1536515cd5b07050000006c617365720000c0bf0000c03f0000c03f6f12833acdcccc3dcdcccc3d0000f041"
    "030000000000803f000020400000807f00000000");
const std::vector<std::byte> kLittleScan = from_hex(
    "0001000000f1536515cd5b07060000006c617365720000000000c0bf0000c03f0000c03f6f12833acdcccc3dcdcccc3d0000f041"
    "030000000000803f000020400000807f00000000");
const std::vector<std::byte> kBigScan = from_hex(
    "000000006553f100075bcd15000000066c61736572000000bfc000003fc000003fc000003a83126f3dcccccd3dcccccd41f00000"
    "000000033f800000402000007f80000000000000");

std::unique_ptr<Error> error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return std::make_unique<Error>(error);
  }
  return nullptr;
}

void read_scan(MessageReader& reader) {
  const MessageHeader header = reader.header();
  EXPECT_EQ(header.stamp_ns, 1'700'000'000'123'456'789);
  EXPECT_EQ(header.frame_id, "laser");
  EXPECT_EQ(reader.read<float>(), -1.5f);
  reader.skip<float>(2);
  EXPECT_EQ(reader.read<float>(), 0.001f);
  reader.skip<float>();
  EXPECT_EQ(reader.read<float>(), 0.1f);
  EXPECT_EQ(reader.read<float>(), 30.0f);
  EXPECT_THAT(reader.sequence<float>(), ElementsAre(1.0f, 2.5f, std::numeric_limits<float>::infinity()));
  EXPECT_EQ(reader.left(), 4U);
  EXPECT_TRUE(reader.sequence<float>().empty());
  EXPECT_EQ(reader.left(), 0U);
}

TEST(MessageReader, reads_one_scan_in_three_forms) {
  MessageReader ros1(kRos1Scan, MessageEncoding::ros1);
  read_scan(ros1);
  MessageReader little(kLittleScan, MessageEncoding::cdr);
  read_scan(little);
  MessageReader big(kBigScan, MessageEncoding::cdr);
  read_scan(big);
}

TEST(MessageReader, numbers_of_cdr_stand_at_multiples_of_their_size) {
  // a byte, a double (7 bytes of padding), a byte, a short (1 of padding), an empty sequence of doubles (no padding
  // after its length), a bool
  const auto message = from_hex(
      "00010000"
      "05"
      "00000000000000"
      "000000000000f83f"
      "07"
      "00"
      "0900"
      "00000000"
      "02");
  MessageReader reader(message, MessageEncoding::cdr);
  EXPECT_EQ(reader.read<std::uint8_t>(), 5);
  EXPECT_EQ(reader.read<double>(), 1.5);
  EXPECT_EQ(reader.read<std::int8_t>(), 7);
  EXPECT_EQ(reader.read<std::int16_t>(), 9);
  EXPECT_TRUE(reader.sequence<double>().empty());
  EXPECT_TRUE(reader.read<bool>());
  EXPECT_EQ(reader.left(), 0U);
}

TEST(MessageReader, numbers_of_ros_1_are_packed) {
  const auto message = from_hex(
      "05"
      "000000000000f83f"
      "0900"
      "02000000"
      "0a0b"
      "000000000000f83f"
      "000000000000f8bf");
  MessageReader reader(message, MessageEncoding::ros1);
  EXPECT_EQ(reader.read<std::uint8_t>(), 5);
  EXPECT_EQ(reader.read<double>(), 1.5);
  EXPECT_EQ(reader.read<std::int16_t>(), 9);
  EXPECT_EQ(reader.bytes(), "\x0a\x0b");
  EXPECT_EQ((reader.array<double, 2>()), (std::array{1.5, -1.5}));
}

TEST(MessageReader, texts_and_sequences_can_be_skipped) {
  const auto message = from_hex(
      "00010000"
      "03000000"
      "616200"
      "00"
      "01000000"
      "00000000"
      "000000000000f83f"
      "2a000000");
  MessageReader reader(message, MessageEncoding::cdr);
  reader.skip_string();
  EXPECT_EQ(reader.count(8), 1U);  // then padding: the double stands at 16
  reader.skip<double>();
  EXPECT_EQ(reader.read<std::int32_t>(), 42);
}

TEST(MessageReader, a_text_of_cdr_may_have_no_bytes_at_all) {
  const auto message = from_hex(
      "00010000"
      "00000000"
      "01000000"
      "00");
  MessageReader reader(message, MessageEncoding::cdr);
  EXPECT_EQ(reader.string(), "");
  EXPECT_EQ(reader.string(), "");
}

TEST(MessageReader, times_of_ros_2_and_durations_may_be_negative) {
  const auto cdr = from_hex(
      "00010000"
      "ffffffff"
      "00ca9a3b");  // -1 s + 1 s
  EXPECT_EQ(MessageReader(cdr, MessageEncoding::cdr).time_ns(), 0);
  const auto ros1 = from_hex(
      "ffffffff"
      "01000000");
  EXPECT_EQ(MessageReader(ros1, MessageEncoding::ros1).time_ns(), 4'294'967'295'000'000'001);
  EXPECT_EQ(MessageReader(ros1, MessageEncoding::ros1).duration_ns(), -999'999'999);
}

TEST(MessageReader, a_message_cut_anywhere_is_an_error_that_says_where) {
  for (const auto encoding : {MessageEncoding::ros1, MessageEncoding::cdr}) {
    const auto& whole = encoding == MessageEncoding::ros1 ? kRos1Scan : kLittleScan;
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const std::vector<std::byte> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
      const auto error = error_of([&] {
        MessageReader reader(cut, encoding);
        reader.header();
        reader.skip<float>(7);
        reader.sequence<float>();
        reader.sequence<float>();
      });
      ASSERT_THAT(error, IsError(ErrorCode::kCorrupt, "the message")) << "cut at " << size;
    }
  }
  const std::vector<std::byte> half(kRos1Scan.begin(), kRos1Scan.begin() + 10);
  EXPECT_THAT(error_of([&] { MessageReader(half, MessageEncoding::ros1).header(); }),
              IsError(ErrorCode::kCorrupt, "4 bytes are expected at byte 8 of it, and 2 bytes are left"));
}

TEST(MessageReader, a_huge_length_asks_for_no_memory) {
  for (const char* size : {"ffffffff", "ffffff7f", "04000000"}) {
    const auto message = from_hex(std::string(size) + "000000");
    const auto read = [&](auto&& what) {
      return error_of([&] { what(MessageReader(message, MessageEncoding::ros1)); });
    };
    EXPECT_THAT(read([](MessageReader reader) { reader.string(); }), IsError(ErrorCode::kCorrupt, "ends early"));
    EXPECT_THAT(read([](MessageReader reader) { reader.bytes(); }), IsError(ErrorCode::kCorrupt, "ends early"));
    EXPECT_THAT(read([](MessageReader reader) { reader.sequence<double>(); }),
                IsError(ErrorCode::kCorrupt, "ends early"));
    EXPECT_THAT(read([](MessageReader reader) { reader.skip_sequence<float>(); }),
                IsError(ErrorCode::kCorrupt, "ends early"));
    EXPECT_THAT(read([](MessageReader reader) { reader.count(); }),
                IsError(ErrorCode::kCorrupt, "and 3 bytes are left"));
  }
  const auto message = from_hex("0000");
  EXPECT_THAT(error_of([&] {
                MessageReader(message, MessageEncoding::ros1).skip<double>(std::numeric_limits<std::size_t>::max());
              }),
              IsError(ErrorCode::kCorrupt, "ends early"));
}

TEST(MessageReader, what_is_no_plain_cdr_is_refused) {
  for (const char* form : {"00030000", "00070000", "ffff0000"})
    EXPECT_THAT(error_of([&] { MessageReader(from_hex(form), MessageEncoding::cdr); }),
                IsError(ErrorCode::kUnsupported, "plain CDR of version 1"));
  const auto message = from_hex(
      "00010000"
      "02000000"
      "6162");
  EXPECT_THAT(error_of([&] { MessageReader(message, MessageEncoding::cdr).string(); }),
              IsError(ErrorCode::kCorrupt, "does not end with NUL"));
}

}  // namespace
}  // namespace mapweave::rawlog::ros
