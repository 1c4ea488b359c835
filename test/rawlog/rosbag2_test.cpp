// Recordings of rosbag2 that the Python package rosbags wrote (and one as early ROS 2 did), whole and damaged.

#include "ros2_recordings.h"

#include <mapweave/core/log.h>
#include <ros/rosbag2_storage.h>
#include <sqlite3.h>
#include <zstd.h>

#include <random>

namespace mapweave::rawlog::ros {
namespace {

using test::own_data;
using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

namespace fs = std::filesystem;

const std::string kTopics = "/scan sensor_msgs/LaserScan cdr 6\n/note std_msgs/String cdr 3\n";

BagReading read_folder(const fs::path& folder, const std::vector<std::size_t>& select = {}) {
  return read_bag([&] { return open_rosbag2_folder(folder); }, select);
}
BagReading read_db3(const fs::path& path, const std::vector<std::size_t>& select = {}) {
  return read_bag([&] { return open_db3(path); }, select);
}

// Without the warnings of what is read thousands of times.
class Rosbag2 : public ::testing::Test {
 protected:
  void SetUp() override { set_log_level(LogLevel::error); }
  void TearDown() override { set_log_level(LogLevel::info); }

  fs::path copy_of(const std::string& name) {
    fs::copy(own_data("ros2/" + name), folder_ / name, fs::copy_options::recursive);
    return folder_ / name;
  }
  static void change(const fs::path& path, const std::string& sql) {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    sqlite3_close(database);
  }
  static void replace_in(const fs::path& path, const std::string& from, const std::string& to) {
    std::string text = bytes_of(path);
    const auto place = text.find(from);
    ASSERT_NE(place, std::string::npos) << from;
    write_bytes(path, text.replace(place, from.size(), to));
  }

  TemporaryFolder folder_;
};

TEST_F(Rosbag2, every_kind_of_folder_holds_the_same) {
  for (const char* name : {"plain", "as_mcap", "file_zstd", "message_zstd", "message_zstd_mcap", "split"}) {
    const auto folder = own_data(std::string("ros2/") + name);
    EXPECT_TRUE(is_rosbag2_folder(folder)) << name;
    EXPECT_EQ(text_of(open_rosbag2_folder(folder)->topics()), kTopics) << name;
    const auto reading = read_folder(folder);
    EXPECT_EQ(reading.error, nullptr) << name << ": " << reading.error->what();
    EXPECT_THAT(reading.lines, ElementsAreArray(recorded_lines())) << name;
    EXPECT_THAT(read_folder(folder, {1}).lines,
                ElementsAre("/note 100.06 note 0", "/note 100.26 note 1", "/note 100.46 note 2"))
        << name;
  }
  EXPECT_FALSE(is_rosbag2_folder(own_data("evo")));
}

TEST_F(Rosbag2, a_part_that_was_packed_is_read_alone) {
  const auto path = own_data("ros2/file_zstd/file_zstd.db3.zstd");
  EXPECT_TRUE(is_zstd(bytes_of(path)));
  const auto reading = read_bag([&] { return open_zstd_part(path, kMostRecordBytes); });
  EXPECT_EQ(reading.error, nullptr) << reading.error->what();
  EXPECT_THAT(reading.lines, ElementsAreArray(recorded_lines()));
  EXPECT_EQ(read_all(path).records.size(), 6U) << "as a log";
}

TEST_F(Rosbag2, a_file_of_it_is_read_alone) {
  for (const char* name : {"plain/plain.db3", "message_zstd/message_zstd.db3"}) {
    const auto path = own_data(std::string("ros2/") + name);
    const auto reading = read_db3(path);
    EXPECT_EQ(reading.error, nullptr) << name << ": " << reading.error->what();
    EXPECT_THAT(reading.lines, ElementsAreArray(recorded_lines())) << name;
    EXPECT_EQ(read_db3(path, {0}).lines.size(), 6U) << name;
    EXPECT_TRUE(is_db3(bytes_of(path)));
    EXPECT_EQ(open_db3(path)->place_name(7), path.string() + " at message 7");
  }
  EXPECT_EQ(read_db3(own_data("ros2/split/split_1.db3")).lines.size(), 5U);
}

TEST_F(Rosbag2, progress_reaches_the_end) {
  for (const char* name : {"plain", "file_zstd", "split", "as_mcap"}) {
    const auto bag = open_rosbag2_folder(own_data(std::string("ros2/") + name));
    BagMessage message;
    std::uint64_t before = 0;
    while (bag->next(message)) {
      EXPECT_GE(bag->bytes_read(), before) << name;
      before = bag->bytes_read();
    }
    EXPECT_EQ(bag->bytes_read(), bag->bytes_total()) << name;
    EXPECT_THAT(bag->place_name(message.place), HasSubstr(name)) << name;
    EXPECT_FALSE(bag->next(message)) << "again after the end";
  }
}

TEST_F(Rosbag2, messages_out_of_order_come_in_order) {
  const auto path = copy_of("plain") / "plain.db3";
  change(path, "UPDATE messages SET id = 100 - id");
  EXPECT_THAT(read_db3(path).lines, ElementsAreArray(recorded_lines()));
}

TEST_F(Rosbag2, a_missing_part_is_named_with_what_to_do) {
  const auto folder = copy_of("split");
  fs::remove(folder / "split_1.db3");
  const auto reading = read_folder(folder);
  EXPECT_THAT(reading.error, IsError(ErrorCode::kMissing, "part 'split_1.db3' of the recording is missing"));
  EXPECT_THAT(reading.error->remedy(), HasSubstr("relative_file_paths"));
  replace_in(folder / "metadata.yaml", "[split_0.db3, split_1.db3]", "[split_0.db3]");
  const auto without = read_folder(folder);
  EXPECT_EQ(without.error, nullptr);
  EXPECT_THAT(without.lines, IsBeginningOfRecording());
  EXPECT_EQ(without.lines.size(), 4U);
}

TEST_F(Rosbag2, parts_may_have_been_compressed_or_unpacked_since) {
  const auto packed = copy_of("file_zstd");
  replace_in(packed / "metadata.yaml", "file_zstd.db3.zstd", "file_zstd/file_zstd.db3");  // as early versions listed it
  EXPECT_THAT(read_folder(packed).lines, ElementsAreArray(recorded_lines()));
  const auto plain = copy_of("plain");
  replace_in(plain / "metadata.yaml", "plain.db3", "plain.db3.zstd");
  EXPECT_THAT(read_folder(plain).lines, ElementsAreArray(recorded_lines()));
}

TEST_F(Rosbag2, without_metadata_the_parts_in_the_folder_are_read) {
  const auto folder = copy_of("split");
  fs::remove(folder / "metadata.yaml");
  fs::rename(folder / "split_1.db3", folder / "split_10.db3");
  fs::rename(folder / "split_0.db3", folder / "split_9.db3");
  set_log_level(LogLevel::warning);
  ::testing::internal::CaptureStderr();
  const auto reading = read_folder(folder);
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), HasSubstr("metadata.yaml is missing"));
  EXPECT_EQ(reading.error, nullptr);
  EXPECT_THAT(reading.lines, ElementsAreArray(recorded_lines()));
  const TemporaryFolder empty;
  EXPECT_FALSE(is_rosbag2_folder(empty.path()));
  EXPECT_THAT(read_folder(empty.path()).error, IsError(ErrorCode::kMissing, "neither metadata.yaml nor parts"));
}

TEST_F(Rosbag2, metadata_that_cannot_be_used_says_why) {
  const auto error_with = [&](const std::string& from, const std::string& to) {
    const TemporaryFolder copies;
    fs::copy(own_data("ros2/split"), copies / "split", fs::copy_options::recursive);
    replace_in(copies / "split/metadata.yaml", from, to);
    return read_folder(copies / "split").error;
  };
  EXPECT_THAT(error_with("sqlite3", "cassette"), IsError(ErrorCode::kUnsupported, "storage_identifier is 'cassette'"));
  EXPECT_THAT(error_with("compression_format: \"\"\n  compression_mode: \"\"",
                         "compression_format: lz5\n  compression_mode: FILE"),
              IsError(ErrorCode::kUnsupported, "compression_format is 'lz5'"));
  EXPECT_THAT(error_with("[split_0.db3, split_1.db3]", "[]"), IsError(ErrorCode::kBadInput, "lists no parts"));
  EXPECT_THAT(error_with("rosbag2_bagfile_information", "rosbag3_bagfile_information"),
              IsError(ErrorCode::kBadInput, "lacks rosbag2_bagfile_information"));
  EXPECT_THAT(error_with("[split_0.db3", "[[split_0.db3"), IsError(ErrorCode::kBadInput, "metadata.yaml:"));
  EXPECT_THAT(error_with("[split_0.db3, split_1.db3]", "[../../secret.db3]"),
              IsError(ErrorCode::kMissing, "part 'secret.db3'"));
}

TEST_F(Rosbag2, what_is_no_recording_is_refused) {
  EXPECT_THAT(read_db3(folder_ / "missing.db3").error, IsError(ErrorCode::kMissing, "does not exist"));
  EXPECT_THAT(read_db3(folder_.path()).error, IsError(ErrorCode::kBadInput, "it is a folder"));
  EXPECT_THAT(read_db3(write_bytes(folder_ / "empty.db3", "")).error, IsError(ErrorCode::kCorrupt, "it is empty"));
  EXPECT_THAT(read_db3(write_bytes(folder_ / "text.db3", std::string(5000, 'a'))).error,
              IsError(ErrorCode::kCorrupt, "no SQLite file"));
  change(folder_ / "other.db3", "CREATE TABLE topics(id)");
  EXPECT_THAT(read_db3(folder_ / "other.db3").error, IsError(ErrorCode::kBadInput, "lacks the tables"));
  const auto plain = copy_of("plain") / "plain.db3";
  change(plain, "UPDATE topics SET serialization_format = 'protobuf'");
  EXPECT_THAT(read_db3(plain).error, IsError(ErrorCode::kUnsupported, "no messages in CDR, but /scan (protobuf)"));
}

TEST_F(Rosbag2, rows_that_make_no_sense_end_the_reading_there) {
  const std::pair<const char*, const char*> cases[] = {
      {"UPDATE messages SET topic_id = 77 WHERE id = 4", "of topic 77, which the table of topics does not hold"},
      {"UPDATE messages SET data = 'text' WHERE id = 4", "column 'data' holds another type"},
      {"UPDATE messages SET data = x'28b52ffd00000000' WHERE id = 4", "the message cannot be unpacked"},
  };
  int number = 0;
  for (const auto& [sql, says] : cases) {
    const auto path = folder_ / (std::to_string(++number) + ".db3");
    fs::copy(own_data("ros2/plain/plain.db3"), path);
    change(path, sql);
    const auto reading = read_db3(path);
    EXPECT_THAT(reading.error, IsError(ErrorCode::kCorrupt, says));
    EXPECT_THAT(reading.lines, IsBeginningOfRecording());
    EXPECT_GE(reading.lines.size(), 3U) << sql;
  }
  fs::copy(own_data("ros2/plain/plain.db3"), folder_ / "stamp.db3");
  change(folder_ / "stamp.db3", "UPDATE messages SET timestamp = x'00' WHERE id = 4");
  EXPECT_THAT(read_db3(folder_ / "stamp.db3").error,
              IsError(ErrorCode::kCorrupt, "column 'timestamp' holds another type"));
}

TEST_F(Rosbag2, what_a_killed_recorder_left_in_its_log_is_read) {
  const auto path = folder_ / "killed.db3", source = own_data("ros2/plain/plain.db3");
  sqlite3* database = nullptr;
  const auto running = folder_ / "running.db3";
  fs::copy(source, running);
  ASSERT_EQ(sqlite3_open(running.c_str(), &database), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(database,
                         "PRAGMA journal_mode = WAL; PRAGMA wal_autocheckpoint = 0;"
                         "CREATE TABLE kept AS SELECT * FROM messages; DELETE FROM messages;"
                         "INSERT INTO messages SELECT * FROM kept; DELETE FROM messages WHERE id > 6",
                         nullptr, nullptr, nullptr),
            SQLITE_OK)
      << sqlite3_errmsg(database);
  for (const char* suffix : {"", "-wal"}) fs::copy(running.string() + suffix, path.string() + suffix);
  sqlite3_close(database);
  ASSERT_GT(fs::file_size(path.string() + "-wal"), 0U);
  const auto reading = read_db3(path);
  EXPECT_EQ(reading.error, nullptr);
  EXPECT_THAT(reading.lines, IsBeginningOfRecording());
  EXPECT_EQ(reading.lines.size(), 6U);
}

// A recording of texts in the topic /note, which cannot be packed well. By default two do not fit into a page.
std::vector<std::string> make_long_recording(const fs::path& path, int messages = 300, std::size_t length_each = 1600) {
  fs::copy(own_data("ros2/plain/plain.db3"), path);
  sqlite3* database = nullptr;
  EXPECT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(
      sqlite3_exec(database, "DELETE FROM messages; PRAGMA page_size = 4096; VACUUM; BEGIN", nullptr, nullptr, nullptr),
      SQLITE_OK);
  sqlite3_stmt* row = nullptr;
  const char* sql =
      "INSERT INTO messages(topic_id, timestamp, data) SELECT id, ?1, ?2 FROM topics WHERE name = '/note'";
  EXPECT_EQ(sqlite3_prepare_v2(database, sql, -1, &row, nullptr), SQLITE_OK);
  std::mt19937_64 random(5);
  std::vector<std::string> lines;
  for (int number = 0; number < messages; ++number) {
    std::string text;
    while (text.size() < length_each) text += std::to_string(random());
    const auto length = static_cast<std::uint32_t>(text.size() + 1);
    std::string data("\0\1\0\0", 4);
    data.append(reinterpret_cast<const char*>(&length), sizeof length).append(text).append(1, '\0');
    sqlite3_bind_int64(row, 1, (100 + number) * 1'000'000'000LL);
    sqlite3_bind_blob(row, 2, data.data(), static_cast<int>(data.size()), SQLITE_TRANSIENT);
    EXPECT_EQ(sqlite3_step(row), SQLITE_DONE) << sqlite3_errmsg(database);
    sqlite3_reset(row);
    lines.push_back("/note " + std::to_string(100 + number) + " " + text);
  }
  sqlite3_finalize(row);
  EXPECT_EQ(sqlite3_exec(database, "COMMIT", nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(database);
  return lines;
}

// Each message before the cut as it was written, none that was not.
void expect_beginning(const BagReading& reading, const std::vector<std::string>& lines, double share) {
  ASSERT_FALSE(reading.lines.empty()) << reading.error->what();
  ASSERT_LE(reading.lines.size(), lines.size());
  EXPECT_TRUE(std::equal(reading.lines.begin(), reading.lines.end(), lines.begin()));
  EXPECT_GT(static_cast<double>(reading.lines.size()), (share - 0.1) * static_cast<double>(lines.size()));
  EXPECT_LT(static_cast<double>(reading.lines.size()), (share + 0.1) * static_cast<double>(lines.size()));
}

TEST_F(Rosbag2, what_precedes_a_cut_is_read_and_the_cut_is_named) {
  const auto lines = make_long_recording(folder_ / "long.db3");
  const std::string bytes = bytes_of(folder_ / "long.db3");
  for (double share = 0.2; share < 0.95; share += 0.031) {  // most of them within a page
    const auto kept = static_cast<std::size_t>(share * static_cast<double>(bytes.size()));
    const auto reading = read_db3(write_bytes(folder_ / "cut.db3", bytes.substr(0, kept)));
    ASSERT_NO_FATAL_FAILURE(expect_beginning(reading, lines, share));
    ASSERT_THAT(reading.error,
                IsError(ErrorCode::kCorrupt, "the recording is cut short: it needs " + std::to_string(bytes.size()) +
                                                 " bytes, " + std::to_string(kept) + " are there"));
    EXPECT_THAT(reading.error->where(), HasSubstr("after " + (folder_ / "cut.db3").string() + " at message " +
                                                  std::to_string(reading.messages.back().place)));
    EXPECT_THAT(reading.error->remedy(), HasSubstr("--keep-going"));
  }
}

// The pages that lead to the messages lie behind most of them.
TEST_F(Rosbag2, what_precedes_an_early_cut_is_read_of_small_and_large_messages) {
  for (const auto& [messages, length] : {std::pair(60'000, std::size_t{40}), {300, 20'000}}) {
    const fs::path path = folder_ / (std::to_string(length) + ".db3");
    const auto lines = make_long_recording(path, messages, length);
    const std::string bytes = bytes_of(path);
    for (const double share : {0.11, 0.3, 0.62, 0.97}) {
      const auto kept = static_cast<std::size_t>(share * static_cast<double>(bytes.size()));
      const auto reading = read_db3(write_bytes(folder_ / "cut.db3", bytes.substr(0, kept)));
      ASSERT_NO_FATAL_FAILURE(expect_beginning(reading, lines, share)) << length << " " << share;
      ASSERT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "the recording is cut short"));
    }
  }
}

// Pages of a cut file are read without what SQLite checks.
TEST_F(Rosbag2, damage_before_a_cut_ends_with_the_cut) {
  make_long_recording(folder_ / "long.db3", 20'000, 40);
  const std::string whole = bytes_of(folder_ / "long.db3");
  const std::string bytes = whole.substr(0, whole.size() / 8);
  std::mt19937_64 random(11);
  for (int round = 0; round < 300; ++round) {
    std::string damaged = bytes;
    for (int k = 0; k < 40; ++k) damaged[8192 + random() % (damaged.size() - 8192)] = static_cast<char>(random());
    const auto reading = read_db3(write_bytes(folder_ / "cut.db3", damaged));
    ASSERT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "the recording is cut short"));
    ASSERT_FALSE(reading.messages.empty());
  }
}

TEST_F(Rosbag2, what_precedes_the_cut_of_a_packed_part_is_read) {
  const auto lines = make_long_recording(folder_ / "long.db3");
  const std::string bytes = bytes_of(folder_ / "long.db3");
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 1));
  const auto part = copy_of("file_zstd") / "file_zstd.db3.zstd";
  EXPECT_THAT(read_folder(write_bytes(part, packed).parent_path()).lines, ElementsAreArray(lines));
  for (const double share : {0.5, 0.7, 0.9}) {
    const auto kept = static_cast<std::size_t>(share * static_cast<double>(packed.size()));
    write_bytes(part, packed.substr(0, kept));
    const auto reading = read_folder(part.parent_path());
    EXPECT_GT(reading.lines.size(), 50U);
    EXPECT_LT(reading.lines.size(), lines.size());
    EXPECT_TRUE(std::equal(reading.lines.begin(), reading.lines.end(), lines.begin())) << share;
    ASSERT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "the zstd is cut short"));
    EXPECT_EQ(reading.error->where(), part.string() + " at byte " + std::to_string(kept));
    EXPECT_THAT(reading.error->remedy(), HasSubstr("--keep-going"));
  }
}

TEST_F(Rosbag2, a_file_cut_anywhere_is_an_error) {
  const std::string bytes = bytes_of(own_data("ros2/plain/plain.db3"));
  for (std::size_t cut = 0; cut < bytes.size(); cut += 37) {
    const auto reading = read_db3(write_bytes(folder_ / "cut.db3", bytes.substr(0, cut)));
    ASSERT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "cut.db3")) << "cut at " << cut;
    ASSERT_THAT(reading.lines, IsBeginningOfRecording());
  }
  const std::string packed = bytes_of(own_data("ros2/file_zstd/file_zstd.db3.zstd"));
  const auto folder = copy_of("file_zstd");
  for (std::size_t cut = 0; cut < packed.size(); cut += 7) {
    write_bytes(folder / "file_zstd.db3.zstd", packed.substr(0, cut));
    const auto reading = read_folder(folder);
    ASSERT_NE(reading.error, nullptr) << "cut at " << cut;
    ASSERT_THAT(reading.error->what(), HasSubstr("file_zstd.db3.zstd")) << "cut at " << cut;
  }
}

TEST_F(Rosbag2, damage_ends_with_a_clear_error_or_is_within_a_message) {
  std::mt19937_64 random(22);
  for (const char* name : {"plain/plain.db3", "message_zstd/message_zstd.db3"}) {
    const std::string bytes = bytes_of(own_data(std::string("ros2/") + name));
    std::size_t failed = 0;
    for (int i = 0; i < 1000; ++i) {
      std::string damaged = bytes;
      const std::size_t length = 1 + random() % 16, begin = random() % bytes.size();
      for (std::size_t place = begin; place < begin + length && place < damaged.size(); ++place)
        damaged[place] = static_cast<char>(i % 3 == 0 ? 0xff : i % 3 == 1 ? damaged[place] ^ (1 << i % 8) : random());
      const auto reading = read_db3(write_bytes(folder_ / "damaged.db3", damaged));
      ASSERT_LE(reading.lines.size(), 1000U);
      if (!reading.error) continue;
      ++failed;
      ASSERT_THAT(reading.error->what(), HasSubstr("damaged.db3"));
      ASSERT_FALSE(reading.error->remedy().empty()) << reading.error->what();
      ASSERT_NE(reading.error->code(), ErrorCode::kInternal) << reading.error->what();
      ASSERT_NE(reading.error->code(), ErrorCode::kCannotWrite) << reading.error->what();
    }
    EXPECT_GT(failed, 100U) << name;
  }
}

}  // namespace
}  // namespace mapweave::rawlog::ros
