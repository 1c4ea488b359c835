// The container: chunks, compression, index, damage.

#include "bags.h"

#include <support/pose_matchers.h>

#include <chrono>
#include <random>

namespace mapweave::rawlog {
namespace {

using test::TemporaryFolder;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Values;

class Ros1Bag : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, Ros1Bag, Values("none", "bz2", "lz4"));

TEST_P(Ros1Bag, is_read_whatever_its_chunks_are_packed_with) {
  const TemporaryFolder folder;
  const auto reading = read_all(write_bag(folder / "a.bag", small_drive(), {GetParam(), 4, true}));
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(kinds(reading.records), "osososososososososos");
  EXPECT_DOUBLE_EQ(reading.records.front().stamp.seconds(), 100.0);
  EXPECT_DOUBLE_EQ(odometry_of(reading.records[18]).x, 0.45);
  EXPECT_FLOAT_EQ(scan_of(reading.records[19]).getScanRange(0), 10.0f);
}

TEST_P(Ros1Bag, is_read_without_an_index_as_after_a_crash) {
  const TemporaryFolder folder;
  testing::internal::CaptureStderr();
  const auto reading = read_all(write_bag(folder / "a.bag", small_drive(), {GetParam(), 4, false}));
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("was not closed"));
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_EQ(reading.records.size(), 20U);
}

TEST_P(Ros1Bag, gives_what_precedes_the_place_where_it_was_cut) {
  const TemporaryFolder folder;
  const std::string whole = bag_bytes(small_drive(), {GetParam(), 4, true});
  std::size_t before = 0;
  for (std::size_t length = 4096 + 30; length < whole.size(); length += 97) {
    const auto reading = read_all(write_bytes(folder / "a.bag", whole.substr(0, length)));
    ASSERT_TRUE(reading.error) << length;
    EXPECT_NE(reading.error->code(), ErrorCode::kInternal);
    EXPECT_FALSE(reading.error->remedy().empty()) << reading.error->what();
    EXPECT_GE(reading.records.size(), before) << length;
    before = reading.records.size();
  }
  EXPECT_EQ(before, 20U);  // cut within the index
}

TEST_P(Ros1Bag, ends_without_an_error_where_its_recorder_crashed) {
  const TemporaryFolder folder;
  const std::string whole = bag_bytes(small_drive(), {GetParam(), 4, false});
  const auto reading = read_all(write_bytes(folder / "a.bag", whole.substr(0, 4109 + (whole.size() - 4109) * 2 / 3)));
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_GT(reading.records.size(), 5U);
  EXPECT_LT(reading.records.size(), 20U);
}

TEST_P(Ros1Bag, survives_any_damage) {
  const TemporaryFolder folder;
  const std::string whole = bag_bytes(small_drive(), {GetParam(), 4, true});
  std::mt19937 random(7);
  std::size_t errors = 0;
  for (int round = 0; round < 1000; ++round) {
    std::string damaged = whole;
    const std::size_t changes = 1 + random() % 4;
    for (std::size_t i = 0; i < changes; ++i) {
      // The padding of the header is long and of no use.
      const std::size_t place = random() % 8 == 0 ? random() % 100 : 4096 + random() % (whole.size() - 4096);
      if (random() % 3 == 0 && place + 4 <= damaged.size())
        damaged.replace(place, 4, std::string("\xff\xff\xff\x7f", 4));
      else
        damaged[place] = static_cast<char>(random());
    }
    const auto reading = read_all(write_bytes(folder / "a.bag", damaged));
    if (!reading.error) continue;
    ++errors;
    EXPECT_NE(reading.error->code(), ErrorCode::kInternal) << reading.error->what();
    EXPECT_FALSE(reading.error->where().empty()) << reading.error->what();
  }
  EXPECT_GT(errors, 300U);
}

struct ByteRange {
  std::size_t begin, end;
};
std::vector<ByteRange> chunks_of(const std::string& bag) {
  const auto length_at = [&](std::size_t place) {
    std::uint32_t length = 0;
    std::memcpy(&length, bag.data() + place, sizeof length);
    return length;
  };
  std::vector<ByteRange> chunks;
  for (std::size_t place = std::string("#ROSBAG V2.0\n").size(); place < bag.size();) {
    const std::size_t header = length_at(place), end = place + 8 + header + length_at(place + 4 + header);
    if (bag.substr(place + 4, header).find(std::string("op=\x05", 4)) != std::string::npos)
      chunks.push_back({place, end});
    place = end;
  }
  return chunks;
}

TEST_P(Ros1Bag, gives_what_precedes_a_damaged_chunk) {
  const TemporaryFolder folder;
  const std::string whole = bag_bytes(small_drive(), {GetParam(), 4, true});
  const auto undamaged = read_all(write_bytes(folder / "whole.bag", whole));
  const std::vector<ByteRange> chunks = chunks_of(whole);
  ASSERT_GE(chunks.size(), 4U);
  std::mt19937 random(11);
  std::size_t errors = 0;
  for (int round = 0; round < 1000; ++round) {
    const auto [begin, end] = chunks[random() % chunks.size()];
    std::string damaged = whole;
    char& byte = damaged[begin + random() % (end - begin)];
    byte = static_cast<char>(byte ^ (1 << random() % 8));
    const auto before = read_all(write_bytes(folder / "cut.bag", whole.substr(0, begin))).records.size();
    const auto reading = read_all(write_bytes(folder / "damaged.bag", damaged));
    errors += reading.error != nullptr;
    // A stamp that was damaged sorts a later one among them.
    std::vector<std::string> all;
    for (const Record& record : reading.records) all.push_back(serialized(*record.observation));
    for (std::size_t i = 0; i < before; ++i)
      ASSERT_THAT(all, Contains(serialized(*undamaged.records[i].observation))) << "round " << round;
  }
  EXPECT_GT(errors, 150U) << "the others change a number within a message";
}

TEST(Ros1BagFile, of_no_bytes_or_no_messages_is_refused) {
  const TemporaryFolder folder;
  EXPECT_THAT(read_all(write_bytes(folder / "empty.bag", "")).error, IsError(ErrorCode::kBadInput, "is empty"));
  EXPECT_THAT(read_all(write_bag(folder / "a.bag", {})).error, IsError(ErrorCode::kBadInput, "holds no topic"));
}

TEST(Ros1BagFile, of_another_version_is_refused) {
  const TemporaryFolder folder;
  const auto reading = read_all(write_bytes(folder / "a.bag", "#ROSBAG V1.2\n" + std::string(100, ' ')));
  EXPECT_THAT(reading.error, IsError(ErrorCode::kUnsupported, "another version than 2.0"));
  EXPECT_THAT(reading.error->what(), HasSubstr("rosbag fix"));
}

TEST(Ros1BagFile, that_claims_huge_sizes_asks_for_no_memory) {
  const TemporaryFolder folder;
  using namespace bag_form;
  // A chunk that says it has 2 GB, and one that unpacks to more than it says.
  const std::string huge = bag_header(0, 0, 0) + MessageBytes()
                                                     .text(op('\x05') + field("compression", "none") +
                                                           number("size", std::uint32_t{2'000'000'000}))
                                                     .number(std::uint32_t{2'000'000'000})
                                                     .bytes();
  const auto first = read_all(write_bytes(folder / "a.bag", huge + std::string(1000, 'x')));
  ASSERT_TRUE(first.error);
  const std::string plain(10'000'000, '\0');
  const std::string bomb =
      bag_header(99'999, 0, 0) +
      record(op('\x05') + field("compression", "bz2") + number("size", std::uint32_t{1000}), packed("bz2", plain));
  EXPECT_THAT(read_all(write_bytes(folder / "b.bag", bomb)).error,
              IsError(ErrorCode::kCorrupt, "unpacks to more than its size says"));
}

// What rosbag record leaves where it is killed: sizes of 0 in the last chunk's header.
TEST(Ros1BagFile, of_a_killed_recorder_is_read_into_its_last_chunk) {
  const TemporaryFolder folder;
  using namespace bag_form;
  for (const char* compression : {"none", "lz4"}) {
    const auto entries = small_drive(1000);
    std::string plain;
    for (std::size_t i = 0; i < entries.size(); ++i) {
      const auto id = static_cast<std::uint32_t>(entries[i].topic == "/scan" ? 0 : entries[i].topic == "/odom" ? 1 : 2);
      if (i < 3) plain += connection(id, entries[i]);
      plain +=
          record(op('\x02') + number("conn", id) + field("time", MessageBytes().time(entries[i].received_s).bytes()),
                 entries[i].data);
    }
    const std::string unfinished =
        MessageBytes()
            .text(op('\x05') + field("compression", compression) + number("size", std::uint32_t{0}))
            .number(std::uint32_t{0})
            .bytes();
    std::string last = packed(compression, plain);
    last.resize(last.size() - 20);
    const auto reading = read_all(write_bytes(folder / "a.bag", bag_header(0, 0, 0) + unfinished + last));
    ASSERT_FALSE(reading.error) << compression << reading.error->what();
    EXPECT_GT(reading.records.size(), std::string(compression) == "none" ? 1998U : 500U) << compression;
  }
}

TEST(Ros1BagFile, in_gz_is_read) {
  const TemporaryFolder folder;
  const std::string bytes = bag_bytes(small_drive());
  {
    mrpt::io::CFileGZOutputStream file((folder / "a.bag.gz").string());
    file.Write(bytes.data(), bytes.size());
  }
  const auto reading = read_all(folder / "a.bag.gz");
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_EQ(reading.records.size(), 20U);
}

// Written by PyPI's rosbags 0.11.9, and by Debian's python3-rosbag 1.15.15: the same drive.
TEST(Ros1BagFile, of_other_programs_is_read) {
  for (const char* name : {"rosbags_lz4.bag", "rosbag_lz4.bag", "rosbag_bz2.bag"}) {
    const auto reading = read_all(test::own_data(name));
    ASSERT_FALSE(reading.error) << reading.error->what();
    ASSERT_EQ(kinds(reading.records), "osososososososososos") << name;
    EXPECT_THAT(odometry_of(reading.records[18]), test::IsNear(Pose2(0.9, 0.0, 0.09), 1e-9, 1e-9));
    const auto& scan = scan_of(reading.records[19]);
    EXPECT_DOUBLE_EQ(reading.records[19].stamp.seconds(), 100.9);
    ASSERT_EQ(scan.getScanSize(), 41U);
    EXPECT_FLOAT_EQ(scan.getScanRange(40), 11.0f);
    EXPECT_FALSE(scan.getScanRangeValidity(3));
    EXPECT_NEAR(scan.sensorPose.x(), 0.2, 1e-9);
    EXPECT_NEAR(ray_angle(scan, 0), M_PI / 2 - 1.0, 1e-6);
  }
}

TEST(Ros1BagFile, with_a_damaged_index_is_read) {
  const TemporaryFolder folder;
  std::string bytes = bag_bytes(small_drive());
  const std::size_t index = bytes.rfind(bag_form::connection(0, bag_transforms(0, {})).substr(0, 30));
  bytes[index + 6] = '\x7f';
  const auto reading = read_all(write_bytes(folder / "a.bag", bytes));
  EXPECT_EQ(reading.records.size(), 20U);
}

}  // namespace
}  // namespace mapweave::rawlog
