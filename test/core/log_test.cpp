#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/journal.h>
#include <mapweave/core/log.h>
#include <mapweave/core/progress.h>
#include <stdlib.h>
#include <sys/stat.h>

namespace mapweave {
namespace {

std::string logged(LogLevel lowest, LogLevel level, const std::string& message) {
  set_log_level(lowest);
  testing::internal::CaptureStderr();
  log(level, message);
  set_log_level(LogLevel::info);
  return testing::internal::GetCapturedStderr();
}

TEST(Log, is_one_line_on_stderr_with_time_and_level) {
  const std::string line = logged(LogLevel::info, LogLevel::warning, "alpha: 3 scans without a match {} %s");
  const std::string expected = " warning: alpha: 3 scans without a match {} %s\n";
  ASSERT_EQ(line.size(), std::string("2001-02-03 04:05:06").size() + expected.size()) << line;
  EXPECT_EQ(line.substr(line.size() - expected.size()), expected);
  EXPECT_EQ(line.find_first_not_of("0123456789-: "), line.find("warning")) << line;
}

// As systemd sets it for a service.
void make_stderr_the_journal() {
  struct stat of_stderr = {};
  ASSERT_EQ(::fstat(2, &of_stderr), 0);
  ::setenv("JOURNAL_STREAM", (std::to_string(of_stderr.st_dev) + ":" + std::to_string(of_stderr.st_ino)).c_str(), 1);
}

TEST(Log, gives_the_journal_the_level_and_leaves_the_time_to_it) {
  testing::internal::CaptureStderr();
  make_stderr_the_journal();
  set_log_level(LogLevel::debug);
  for (const LogLevel level : {LogLevel::debug, LogLevel::info, LogLevel::warning, LogLevel::error})
    log(level, "a line");
  set_log_level(LogLevel::info);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "<7>a line\n<6>a line\n<4>a line\n<3>a line\n");
  ::unsetenv("JOURNAL_STREAM");
}

TEST(Log, of_a_service_that_was_redirected_has_its_time) {
  make_stderr_the_journal();
  const std::string line = logged(LogLevel::info, LogLevel::error, "a line");  // captured: another file by now
  ::unsetenv("JOURNAL_STREAM");
  EXPECT_NE(line.find(" error: a line\n"), std::string::npos) << line;
  EXPECT_EQ(line.find('<'), std::string::npos) << line;
}

TEST(Log, leaves_out_what_is_below_its_level) {
  EXPECT_EQ(logged(LogLevel::warning, LogLevel::info, "chatter"), "");
  EXPECT_NE(logged(LogLevel::debug, LogLevel::debug, "chatter"), "");
  EXPECT_NE(logged(LogLevel::error, LogLevel::error, "trouble"), "");
}

TEST(Log, knows_the_names_of_its_levels) {
  EXPECT_EQ(log_level_from_text("debug"), LogLevel::debug);
  EXPECT_EQ(log_level_from_text("info"), LogLevel::info);
  EXPECT_EQ(log_level_from_text("warning"), LogLevel::warning);
  EXPECT_EQ(log_level_from_text("error"), LogLevel::error);
  EXPECT_THROW(log_level_from_text("loud"), Error);
}

TEST(Log, progress_is_quiet_where_only_errors_are_wanted) {
  const auto shown = [](LogLevel lowest) {
    set_log_level(lowest);
    testing::internal::CaptureStderr();
    const auto progress = make_terminal_progress();
    { const ProgressTask task(*progress, "robot alpha", 3, "scans"); }
    set_log_level(LogLevel::info);
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_NE(shown(LogLevel::info), "");
  EXPECT_EQ(shown(LogLevel::warning), "");
  EXPECT_EQ(shown(LogLevel::error), "");
}

}  // namespace
}  // namespace mapweave
