// MCAP recordings that the Python package mcap wrote, whole and damaged.

#include "ros2_recordings.h"

#include <mapweave/core/log.h>
#include <ros/mcap_reader.h>
#include <ros/mcap_records.h>

#include <algorithm>
#include <cstring>
#include <random>

namespace mapweave::rawlog::ros {
namespace {

using test::own_data;
using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

const std::string kTopics = "/scan sensor_msgs/LaserScan cdr 6\n/note std_msgs/String cdr 3\n";
const std::string kTopicsWithoutCounts = "/scan sensor_msgs/LaserScan cdr 0\n/note std_msgs/String cdr 0\n";

std::filesystem::path recording(const std::string& name) { return own_data("ros2/" + name); }
BagReading read_mcap(const std::filesystem::path& path, const std::vector<std::size_t>& select = {}) {
  return read_bag([&] { return open_mcap(path); }, select);
}
std::string bytes_of_recording(const std::string& name) { return bytes_of(recording(name)); }

// Without the warnings of what is read thousands of times.
class Mcap : public ::testing::Test {
 protected:
  void SetUp() override { set_log_level(LogLevel::error); }
  void TearDown() override { set_log_level(LogLevel::info); }
};

struct PlacedMcapRecord {
  std::size_t begin, end;
  Opcode opcode;
};
std::vector<PlacedMcapRecord> records_of(const std::string& bytes) {
  std::vector<PlacedMcapRecord> records;
  for (std::size_t place = mcap::kMagic.size(); place + kRecordHeadBytes < bytes.size();) {
    const RecordHead head = parse_head(bytes.data() + place);
    records.push_back({place, place + kRecordHeadBytes + static_cast<std::size_t>(head.bytes), head.opcode});
    place = records.back().end;
  }
  return records;
}
template <class Number>
std::string with_number(std::string bytes, std::size_t place, Number number) {
  std::memcpy(bytes.data() + place, &number, sizeof number);
  return bytes;
}

TEST_F(Mcap, compressed_or_not_it_holds_the_same) {
  for (const char* name : {"none.mcap", "lz4.mcap", "zstd.mcap", "unchunked.mcap", "as_mcap/as_mcap.mcap"}) {
    const auto reading = read_mcap(recording(name));
    EXPECT_EQ(reading.error, nullptr) << name << ": " << reading.error->what();
    EXPECT_THAT(reading.lines, ElementsAreArray(recorded_lines())) << name;
    EXPECT_EQ(text_of(open_mcap(recording(name))->topics()), kTopics) << name << ": known from the beginning";
  }
}

TEST_F(Mcap, without_a_summary_topics_are_known_from_the_start_too) {
  const auto bag = open_mcap(recording("no_summary.mcap"));
  EXPECT_EQ(text_of(bag->topics()), kTopicsWithoutCounts);
  const auto reading = read_mcap(recording("no_summary.mcap"));
  EXPECT_EQ(reading.error, nullptr);
  EXPECT_THAT(reading.lines, ElementsAreArray(recorded_lines()));
  EXPECT_EQ(read_mcap(recording("no_summary.mcap"), {1}).lines.size(), 3U);
}

TEST_F(Mcap, messages_of_ros_1_are_read_as_such) {
  const auto reading = read_mcap(recording("ros1.mcap"));
  EXPECT_EQ(reading.error, nullptr);
  EXPECT_THAT(reading.lines, ElementsAreArray(recorded_lines()));
  EXPECT_EQ(text_of(reading.topics), "/scan sensor_msgs/LaserScan ros1 6\n/note std_msgs/String ros1 3\n");
}

TEST_F(Mcap, chunks_and_messages_out_of_order_come_in_order) {
  const auto reading = read_mcap(recording("chunks_out_of_order.mcap"));
  EXPECT_EQ(reading.error, nullptr);
  EXPECT_THAT(reading.lines, ElementsAreArray(recorded_lines()));
}

TEST_F(Mcap, only_selected_topics_are_delivered) {
  for (const char* name : {"none.mcap", "zstd.mcap", "unchunked.mcap"}) {
    EXPECT_THAT(read_mcap(recording(name), {1}).lines,
                ElementsAre("/note 100.06 note 0", "/note 100.26 note 1", "/note 100.46 note 2"))
        << name;
    EXPECT_EQ(read_mcap(recording(name), {0}).lines.size(), 6U) << name;
  }
}

TEST_F(Mcap, bytes_read_reach_the_data_s_end) {
  for (const char* name : {"lz4.mcap", "unchunked.mcap"}) {
    const auto bag = open_mcap(recording(name));
    BagMessage message;
    std::uint64_t before = 0;
    while (bag->next(message)) {
      EXPECT_GE(bag->bytes_read(), before);
      before = bag->bytes_read();
      EXPECT_LT(message.place, bag->bytes_total());
    }
    EXPECT_GT(before, bag->bytes_total() / 2);
    EXPECT_LE(before, bag->bytes_total());
    EXPECT_FALSE(bag->next(message)) << "again after the end";
    EXPECT_EQ(bag->place_name(17), recording(name).string() + " at byte 17");
  }
}

TEST_F(Mcap, what_holds_no_messages_of_ros_is_refused) {
  const TemporaryFolder folder;
  std::string bytes = bytes_of_recording("unchunked.mcap");
  for (std::size_t place = 0; (place = bytes.find("cdr", place)) != std::string::npos;) bytes.replace(place, 3, "abc");
  const auto reading = read_mcap(write_bytes(folder / "a.mcap", bytes));
  EXPECT_TRUE(reading.lines.empty());
  ASSERT_NE(reading.error, nullptr);  // checksums were left as they were: the summary is of no use, the data wrong
  const auto error = read_mcap(write_bytes(folder / "b.mcap", bytes.substr(0, records_of(bytes).back().begin))).error;
  EXPECT_THAT(
      error,
      IsError(ErrorCode::kUnsupported,
              "holds no messages of ROS (encodings ros1 and cdr), but /scan (abc), /note (abc), /status (json)"));
}

TEST_F(Mcap, what_is_no_recording_is_refused) {
  const TemporaryFolder folder;
  EXPECT_THAT(read_mcap(write_bytes(folder / "empty.mcap", "")).error,
              IsError(ErrorCode::kBadInput, "empty (0 bytes)"));
  EXPECT_THAT(read_mcap(write_bytes(folder / "short.mcap", "\x89MC")).error, IsError(ErrorCode::kBadInput, "no MCAP"));
  EXPECT_THAT(read_mcap(write_bytes(folder / "text.mcap", std::string(1000, 'a'))).error,
              IsError(ErrorCode::kBadInput, "no MCAP recording"));
  EXPECT_THAT(read_mcap(folder / "missing.mcap").error, IsError(ErrorCode::kMissing, "missing.mcap"));
  EXPECT_THAT(read_mcap(folder.path()).error, IsError(ErrorCode::kBadInput, "no file"));
  std::string later = bytes_of_recording("none.mcap");
  later[5] = '1';
  EXPECT_THAT(read_mcap(write_bytes(folder / "later.mcap", later)).error,
              IsError(ErrorCode::kUnsupported, "another version of MCAP"));
}

TEST_F(Mcap, cut_within_its_first_bytes_it_is_refused) {
  const TemporaryFolder folder;
  for (std::size_t cut = 1; cut < mcap::kMagic.size(); ++cut) {
    const auto path = write_bytes(folder / "cut.mcap", std::string(mcap::kMagic.substr(0, cut)));
    EXPECT_THAT(read_all(path).error, IsError(ErrorCode::kCorrupt, "does not begin as one")) << cut;
  }
}

TEST_F(Mcap, cut_at_any_byte_it_gives_what_was_whole) {
  const TemporaryFolder folder;
  for (const char* name : {"none.mcap", "zstd.mcap", "unchunked.mcap"}) {
    const std::string bytes = bytes_of_recording(name);
    const auto records = records_of(bytes);
    const auto data_end = std::find_if(records.begin(), records.end(), [](const PlacedMcapRecord& record) {
      return record.opcode == Opcode::kDataEnd;
    });
    std::size_t most = 0;
    for (std::size_t cut = mcap::kMagic.size(); cut < bytes.size(); ++cut) {
      const auto reading = read_mcap(write_bytes(folder / "cut.mcap", bytes.substr(0, cut)));
      ASSERT_THAT(reading.lines, IsBeginningOfRecording()) << name << " cut at " << cut;
      ASSERT_GE(reading.lines.size(), most) << name << " cut at " << cut;
      most = reading.lines.size();
      const bool at_a_boundary = cut == mcap::kMagic.size() || cut >= data_end->begin + kRecordHeadBytes ||
                                 std::any_of(records.begin(), records.end(),
                                             [&](const PlacedMcapRecord& record) { return record.end == cut; });
      ASSERT_EQ(reading.error == nullptr, at_a_boundary) << name << " cut at " << cut;
      if (!at_a_boundary) {
        ASSERT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "the file ends within ")) << name << " cut at " << cut;
      }
    }
    EXPECT_EQ(most, recorded_lines().size()) << name;
  }
}

TEST_F(Mcap, of_a_chunk_that_was_cut_short_what_is_whole_is_read) {
  const TemporaryFolder folder;
  for (const char* name : {"none.mcap", "no_summary.mcap", "lz4.mcap"}) {
    const std::string bytes = bytes_of_recording(name);
    for (const PlacedMcapRecord& record : records_of(bytes)) {
      if (record.opcode != Opcode::kChunk) continue;
      const auto before = read_mcap(write_bytes(folder / "before.mcap", bytes.substr(0, record.begin)));
      const auto cut = read_mcap(write_bytes(folder / "cut.mcap", bytes.substr(0, record.end - 1)));
      const auto whole = read_mcap(write_bytes(folder / "whole.mcap", bytes.substr(0, record.end)));
      EXPECT_THAT(cut.error, IsError(ErrorCode::kCorrupt, "the file ends within a record")) << name;
      EXPECT_GE(cut.lines.size(), before.lines.size()) << name;
      if (std::string(name) == "no_summary.mcap") {
        EXPECT_EQ(cut.lines.size() + 1, whole.lines.size()) << "all but the last message";
      }
    }
  }
}

TEST_F(Mcap, a_flipped_bit_in_a_chunk_is_found_by_its_checksum) {
  const TemporaryFolder folder;
  for (const char* name : {"none.mcap", "lz4.mcap", "zstd.mcap", "unchunked.mcap"}) {
    const std::string bytes = bytes_of_recording(name);
    const bool is_chunked = std::string(name) != "unchunked.mcap";
    std::size_t found = 0, same = 0;
    const auto records = records_of(bytes);
    for (std::size_t place = mcap::kMagic.size(); place < bytes.size(); ++place) {
      std::string damaged = bytes;
      damaged[place] = static_cast<char>(damaged[place] ^ (1 << place % 8));
      const auto reading = read_mcap(write_bytes(folder / "flipped.mcap", damaged));
      if (reading.error) ++found;
      if (!reading.error && reading.lines == recorded_lines()) ++same;
      if (reading.error) {
        ASSERT_THAT(reading.error->what(), HasSubstr("flipped.mcap")) << name << " byte " << place;
        ASSERT_FALSE(reading.error->remedy().empty()) << reading.error->what();
      }
      const auto record =
          std::find_if(records.begin(), records.end(), [&](const PlacedMcapRecord& one) { return place < one.end; });
      // Within the packed records of a chunk nothing may pass; messages beside chunks have the checksum of all data.
      if (is_chunked && record != records.end() && record->opcode == Opcode::kChunk &&
          place > record->begin + kRecordHeadBytes + 44) {
        ASSERT_TRUE(reading.error != nullptr || reading.lines == recorded_lines()) << name << " byte " << place;
        ASSERT_THAT(reading.lines, IsBeginningOfRecording()) << name << " byte " << place;
      }
      if (!is_chunked && record != records.end() && record->opcode == Opcode::kMessage) {
        ASSERT_NE(reading.error, nullptr) << name << " byte " << place;
      }
    }
    EXPECT_GT(found, 300U) << name;
    EXPECT_GT(same, 100U) << name << ": what damages the summary alone does no harm";
  }
}

TEST_F(Mcap, damage_at_random_places_ends_with_a_clear_error_or_the_end) {
  const TemporaryFolder folder;
  std::mt19937_64 random(20);
  std::size_t failed = 0;
  for (const char* name : {"none.mcap", "lz4.mcap", "zstd.mcap", "unchunked.mcap", "no_summary.mcap"}) {
    const std::string bytes = bytes_of_recording(name);
    for (int i = 0; i < 200; ++i) {
      std::string damaged = bytes;
      const std::size_t length = 1 + random() % 16, begin = mcap::kMagic.size() + random() % (bytes.size() - 40);
      for (std::size_t place = begin; place < begin + length && place < damaged.size(); ++place)
        damaged[place] = static_cast<char>(i % 3 == 0 ? 0xff : i % 3 == 1 ? 0 : random());
      const auto reading = read_mcap(write_bytes(folder / "damaged.mcap", damaged));
      if (!reading.error) continue;
      ++failed;
      ASSERT_FALSE(reading.error->problem().empty());
      ASSERT_THAT(reading.error->what(), HasSubstr("damaged.mcap"));
      ASSERT_NE(reading.error->code(), ErrorCode::kInternal) << reading.error->what();
    }
  }
  EXPECT_GT(failed, 300U);
}

TEST_F(Mcap, huge_claims_ask_for_no_memory) {
  const TemporaryFolder folder;
  for (const char* name : {"none.mcap", "zstd.mcap", "unchunked.mcap", "no_summary.mcap"}) {
    const std::string bytes = bytes_of_recording(name);
    for (const PlacedMcapRecord& record : records_of(bytes))
      for (const std::uint64_t huge : {~std::uint64_t{0}, std::uint64_t{1} << 62, std::uint64_t{1} << 31}) {
        const auto reading = read_mcap(write_bytes(folder / "huge.mcap", with_number(bytes, record.begin + 1, huge)));
        ASSERT_THAT(reading.lines, IsBeginningOfRecording());
        if (reading.error) {
          ASSERT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "the file ends within ")) << name;
        }
      }
  }
  // A chunk that claims to unpack to much: the buffer grows with what comes out, which is less.
  const std::string packed = bytes_of_recording("zstd.mcap");
  const auto records = records_of(packed);
  const auto chunk = std::find_if(records.begin(), records.end(),
                                  [](const PlacedMcapRecord& record) { return record.opcode == Opcode::kChunk; });
  for (const std::uint64_t huge : {~std::uint64_t{0}, std::uint64_t{1} << 30, std::uint64_t{10}}) {
    const auto lied = with_number(packed, chunk->begin + kRecordHeadBytes + 16, huge);
    EXPECT_THAT(read_mcap(write_bytes(folder / "lied.mcap", lied)).error, IsError(ErrorCode::kCorrupt, " at byte "));
  }
}

TEST_F(Mcap, a_wrong_checksum_says_what_is_lost) {
  const TemporaryFolder folder;
  const std::string bytes = bytes_of_recording("none.mcap");
  const auto records = records_of(bytes);
  std::vector<PlacedMcapRecord> chunks;
  std::copy_if(records.begin(), records.end(), std::back_inserter(chunks),
               [](const PlacedMcapRecord& record) { return record.opcode == Opcode::kChunk; });
  ASSERT_EQ(chunks.size(), 3U);
  std::string damaged = bytes;
  damaged[chunks[1].end - 3] = static_cast<char>(damaged[chunks[1].end - 3] ^ 4);
  const auto reading = read_mcap(write_bytes(folder / "damaged.mcap", damaged));
  EXPECT_EQ(reading.lines.size(), 2U);
  EXPECT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "the checksum of a chunk is wrong"));
  EXPECT_THAT(reading.error->what(), HasSubstr("at byte " + std::to_string(chunks[1].begin)));
  // Without a checksum the damage is a scan's range, which nobody can know.
  const auto silent = with_number(damaged, chunks[1].begin + kRecordHeadBytes + 24, std::uint32_t{0});
  EXPECT_EQ(read_mcap(write_bytes(folder / "silent.mcap", silent)).error, nullptr);
}

TEST_F(Mcap, a_message_that_makes_no_sense_may_be_of_a_damaged_chunk) {
  const TemporaryFolder folder;
  const std::string bytes = bytes_of_recording("none.mcap");
  const auto records = records_of(bytes);
  const auto last = std::find_if(records.rbegin(), records.rend(),
                                 [](const PlacedMcapRecord& record) { return record.opcode == Opcode::kChunk; });
  const std::size_t cdr = bytes.find(std::string("\0\1\0\0\x64\0\0\0", 8), last->begin);
  ASSERT_LT(cdr, last->end);
  const std::string unchecked = with_number(bytes, last->begin + kRecordHeadBytes + 24, std::uint32_t{0});
  const auto error = read_all(write_bytes(folder / "a.mcap", with_number(unchecked, cdr, std::uint8_t{7}))).error;
  EXPECT_THAT(error,
              IsError(ErrorCode::kUnsupported, "the chunk that begins there has no checksum and may be damaged"));
  EXPECT_THAT(error->where(), HasSubstr("a.mcap at byte " + std::to_string(last->begin) + ", topic /scan"));
  // Where there is no chunk, none is blamed.
  const auto unchunked = bytes_of_recording("unchunked.mcap");
  const std::size_t alone = unchunked.find(std::string("\0\1\0\0\x64\0\0\0", 8));
  const auto written = read_all(write_bytes(folder / "b.mcap", with_number(unchunked, alone, std::uint8_t{7}))).error;
  ASSERT_NE(written, nullptr);
  EXPECT_EQ(std::string(written->what()).find("chunk"), std::string::npos);
}

TEST_F(Mcap, a_bag_that_its_recorder_did_not_finish_is_read_with_a_warning) {
  const TemporaryFolder folder;
  const std::string bytes = bytes_of_recording("lz4.mcap");
  const auto records = records_of(bytes);
  const auto data_end = std::find_if(records.begin(), records.end(),
                                     [](const PlacedMcapRecord& record) { return record.opcode == Opcode::kDataEnd; });
  const auto path = write_bytes(folder / "unfinished.mcap", bytes.substr(0, data_end->begin));
  set_log_level(LogLevel::warning);
  ::testing::internal::CaptureStderr();
  const auto reading = read_mcap(path);
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), HasSubstr("was not finished"));
  EXPECT_EQ(reading.error, nullptr);
  EXPECT_THAT(reading.lines, ElementsAreArray(recorded_lines()));
}

TEST_F(Mcap, records_of_more_than_may_be_held_are_damage) {
  EXPECT_EQ(read_bag([] { return open_mcap(recording("zstd.mcap"), 2000); }).error, nullptr);
  EXPECT_THAT(read_bag([] { return open_mcap(recording("zstd.mcap"), 100); }).error,
              IsError(ErrorCode::kCorrupt, "at most 100 are read"));
}

}  // namespace
}  // namespace mapweave::rawlog::ros
