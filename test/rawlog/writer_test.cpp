#include "logs.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/rawlog/convert.h>
#include <mapweave/rawlog/rawlog_writer.h>
#include <mrpt/obs/CRawlog.h>
#include <signal.h>
#include <sys/resource.h>

namespace mapweave::rawlog {
namespace {

using test::own_data;
using test::TemporaryFolder;
using ::testing::HasSubstr;

std::size_t files_in(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::directory_iterator(folder), std::filesystem::directory_iterator{}));
}

// Writing beyond `bytes` fails, as on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : old_action_(::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit limit{bytes, old_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &old_);
    ::signal(SIGXFSZ, old_action_);
  }

 private:
  rlimit old_{};
  sighandler_t old_action_;
};

TEST(RawlogWriter, writes_what_it_and_mrpt_read_back) {
  const TemporaryFolder folder;
  const std::vector<mrpt::obs::CObservation::Ptr> observations = {odometry(1.0, 0.1), scan(1.0), scan(2.0)};
  RawlogWriter writer(folder / "a.rawlog");
  for (const auto& observation : observations) writer.add(*observation);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.rawlog"));
  writer.close();
  EXPECT_EQ(writer.count(), 3u);
  EXPECT_EQ(files_in(folder.path()), 1u);

  const auto reading = read_all(folder / "a.rawlog");
  ASSERT_FALSE(reading.error);
  ASSERT_EQ(reading.records.size(), 3u);
  mrpt::obs::CRawlog by_mrpt;
  ASSERT_TRUE(by_mrpt.loadFromRawLogFile((folder / "a.rawlog").string()));
  ASSERT_EQ(by_mrpt.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(serialized(*reading.records[i].observation), serialized(*observations[i]));
    EXPECT_EQ(serialized(*by_mrpt.getAsObservation(i)), serialized(*observations[i]));
  }
}

TEST(RawlogWriter, writes_the_same_bytes_twice) {
  const TemporaryFolder folder;
  for (const char* name : {"a.rawlog", "b.rawlog"}) {
    RawlogWriter writer(folder / name);
    for (int i = 0; i < 1000; ++i) writer.add(*scan(i));
    writer.close();
  }
  EXPECT_EQ(bytes_of(folder / "a.rawlog"), bytes_of(folder / "b.rawlog"));
}

TEST(RawlogWriter, leaves_nothing_when_it_is_not_closed) {
  const TemporaryFolder folder;
  write_bytes(folder / "a.rawlog", "old");
  {
    RawlogWriter writer(folder / "a.rawlog");
    writer.add(*scan(1.0));
  }
  EXPECT_EQ(files_in(folder.path()), 1u);
  EXPECT_EQ(bytes_of(folder / "a.rawlog"), "old");
}

TEST(RawlogWriter, leaves_nothing_when_the_disk_is_full) {
  const TemporaryFolder folder;
  const FileSizeLimit limit(4096);
  RawlogWriter writer(folder / "a.rawlog");
  try {
    for (int i = 0; i < 20'000; ++i)
      writer.add(*scan(i, {static_cast<float>(std::sin(i)), static_cast<float>(std::cos(i))}));
    writer.close();
    FAIL() << "4096 bytes were enough";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCannotWrite);
    EXPECT_THAT(error.what(), HasSubstr("a.rawlog"));
  }
  EXPECT_EQ(files_in(folder.path()), 0u);
}

TEST(RawlogWriter, says_when_it_cannot_begin) {
  try {
    RawlogWriter writer("/nowhere/at/all/a.rawlog");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCannotWrite);
  }
}

TEST(Convert, makes_a_rawlog_of_any_format) {
  const TemporaryFolder folder;
  const auto progress = make_silent_progress();
  for (const char* name : {"carmen_old.log", "carmen_new.log", "g2o_scans.g2o", "rawlog_pairs.rawlog"}) {
    const auto before = read_all(own_data(name));
    EXPECT_EQ(convert_log(own_data(name), folder / "out.rawlog", *progress), before.records.size());
    const auto after = read_all(folder / "out.rawlog");
    ASSERT_FALSE(after.error);
    ASSERT_EQ(after.records.size(), before.records.size());
    for (std::size_t i = 0; i < after.records.size(); ++i) {
      EXPECT_EQ(after.records[i].stamp, before.records[i].stamp);
      EXPECT_EQ(serialized(*after.records[i].observation), serialized(*before.records[i].observation));
    }
  }
}

TEST(Convert, leaves_nothing_of_a_damaged_log) {
  const TemporaryFolder folder, out;
  const std::string bytes = bytes_of(own_data("rawlog_pairs.rawlog"));
  const auto damaged = write_bytes(folder / "cut.rawlog", bytes.substr(0, bytes.size() - 100));
  EXPECT_THROW(convert_log(damaged, out / "out.rawlog", *make_silent_progress()), Error);
  EXPECT_EQ(files_in(out.path()), 0u);
}

TEST(Convert, stops_when_interrupted) {
  const TemporaryFolder folder, out;
  std::vector<Object> scans;
  for (int i = 0; i < 600; ++i) scans.push_back(scan(i));
  const auto path = write_rawlog(folder / "a.rawlog", scans);
  request_interrupt();
  EXPECT_THROW(convert_log(path, out / "out.rawlog", *make_silent_progress()), Interrupted);
  clear_interrupt();
  EXPECT_EQ(files_in(out.path()), 0u);
}

}  // namespace
}  // namespace mapweave::rawlog
