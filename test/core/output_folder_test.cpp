#include "small_disk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <sys/wait.h>
#include <unistd.h>

#include <support/temporary_folder.h>
#include <optional>
#include <set>

namespace mapweave {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

void expect_refused(const fs::path& path, bool force, const std::string& why) {
  try {
    OutputFolder refused(path, force);
    FAIL() << path << " was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCannotWrite);
    EXPECT_THAT(error.what(), HasSubstr(why));
  }
}

int number_of_a_dead_process() {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  ::waitpid(child, nullptr, 0);
  return child;
}

void make_results(const fs::path& path, const std::string& text) {
  OutputFolder output(path, true);
  write_file(output.staging() / "manifest.json", text);
  output.commit();
}

TEST(OutputFolder, says_at_once_that_a_link_leads_nowhere) {
  const test::TemporaryFolder folder;
  fs::create_symlink(folder / "gone", folder / "out");
  expect_refused(folder / "out", false, "is a link to " + (folder / "gone").string() + ", which is not there");
}

TEST(OutputFolder, says_at_once_that_another_run_writes_there) {
  const test::TemporaryFolder folder;
  int ready[2], over[2];
  ASSERT_EQ(::pipe(ready) + ::pipe(over), 0);
  const pid_t other = ::fork();
  if (other == 0) {
    char byte = 0;
    {
      OutputFolder output(folder / "out", false);
      [[maybe_unused]] const auto sent = ::write(ready[1], &byte, 1);
      [[maybe_unused]] const auto received = ::read(over[0], &byte, 1);
    }
    ::_exit(0);
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  expect_refused(folder / "out", false, "another run (process " + std::to_string(other) + ") is writing");
  ASSERT_EQ(::write(over[1], &byte, 1), 1);
  ::waitpid(other, nullptr, 0);
  OutputFolder output(folder / "out", false);
}

TEST(OutputFolder, says_that_files_came_there_meanwhile) {
  const test::TemporaryFolder folder;
  OutputFolder output(folder / "out", false);
  write_file(output.staging() / "manifest.json", "mine");
  fs::create_directory(folder / "out");
  write_file(folder / "out/theirs", "theirs");
  try {
    output.commit();
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("somebody else has put files there since this run began"));
  }
}

TEST(OutputFolder, appears_whole_at_commit) {
  const test::TemporaryFolder folder;
  {
    OutputFolder output(folder / "out", false);
    EXPECT_EQ(output.goal(), folder / "out");
    EXPECT_EQ(output.staging(), folder / ("out.partial-" + std::to_string(::getpid())));
    fs::create_directories(output.staging() / "robots/alpha");
    write_file(output.staging() / "robots/alpha/map.png", "picture");
    EXPECT_FALSE(fs::exists(folder / "out"));
    output.commit();
  }
  EXPECT_EQ(read_file(folder / "out/robots/alpha/map.png"), "picture");
  EXPECT_THAT(names_in(folder.path()), UnorderedElementsAre("out"));
}

TEST(OutputFolder, leaves_nothing_when_it_is_not_committed) {
  const test::TemporaryFolder folder;
  {
    OutputFolder output(folder / "new/deep/out", false);
    write_file(output.staging() / "half", "x");
  }
  EXPECT_TRUE(fs::is_empty(folder.path())) << "nor the parents that it made";
}

TEST(OutputFolder, leaves_parents_that_others_have_come_to_use) {
  const test::TemporaryFolder folder;
  {
    OutputFolder output(folder / "new/deep/out", false);
    write_file(folder / "new/mine", "x");
  }
  EXPECT_THAT(names_in(folder / "new"), UnorderedElementsAre("mine"));
}

TEST(OutputFolder, accepts_an_empty_folder_and_a_slash_at_the_end) {
  const test::TemporaryFolder folder;
  fs::create_directory(folder / "out");
  OutputFolder output((folder / "out").string() + "/", false);
  write_file(output.staging() / "a", "x");
  output.commit();
  EXPECT_EQ(read_file(folder / "out/a"), "x");
}

TEST(OutputFolder, never_overwrites_unasked) {
  const test::TemporaryFolder folder;
  make_results(folder / "out", "old");
  expect_refused(folder / "out", false, "exists and is not empty; choose another folder, or replace it with --force");
  write_file(folder / "file", "x");
  expect_refused(folder / "file", true, "is a file");
  expect_refused(folder / "file/below", true, "file/below");
  EXPECT_THAT(names_in(folder.path()), UnorderedElementsAre("out", "file"));
}

TEST(OutputFolder, does_not_overwrite_what_appeared_meanwhile) {
  const test::TemporaryFolder folder;
  OutputFolder output(folder / "out", false);
  write_file(output.staging() / "a", "mine");
  fs::create_directory(folder / "out");
  write_file(folder / "out/b", "theirs");
  EXPECT_THROW(output.commit(), Error);
  EXPECT_THAT(names_in(folder / "out"), UnorderedElementsAre("b"));
}

TEST(OutputFolder, replaces_old_results_by_force_and_only_at_commit) {
  const test::TemporaryFolder folder;
  make_results(folder / "out", "old");
  write_file(folder / "out/stale.png", "x");
  {
    OutputFolder abandoned(folder / "out", true);
    write_file(abandoned.staging() / "manifest.json", "half");
  }
  EXPECT_EQ(read_file(folder / "out/manifest.json"), "old");
  make_results(folder / "out", "new");
  EXPECT_EQ(read_file(folder / "out/manifest.json"), "new");
  EXPECT_THAT(names_in(folder / "out"), UnorderedElementsAre("manifest.json"));
  EXPECT_THAT(names_in(folder.path()), UnorderedElementsAre("out"));
}

TEST(OutputFolder, does_not_replace_a_folder_of_somebody_else_even_by_force) {
  const test::TemporaryFolder folder;
  fs::create_directory(folder / "thesis");
  write_file(folder / "thesis/chapter1.tex", "years of work");
  expect_refused(folder / "thesis", true, "has no manifest.json");
  EXPECT_EQ(read_file(folder / "thesis/chapter1.tex"), "years of work");
}

TEST(OutputFolder, follows_a_link_to_the_folder_it_replaces) {
  const test::TemporaryFolder folder;
  make_results(folder / "real", "old");
  fs::create_directory_symlink(folder / "real", folder / "link");
  make_results(folder / "link", "new");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(read_file(folder / "real/manifest.json"), "new");
}

TEST(OutputFolder, clears_away_what_a_crashed_run_left) {
  const test::TemporaryFolder folder;
  const std::string dead = std::to_string(number_of_a_dead_process());
  fs::create_directories(folder / ("out.partial-" + dead) / "robots");
  fs::create_directories(folder / ("out.partial-" + std::to_string(::getpid())));   // a number that came back
  fs::create_directories(folder / ("out.partial-" + std::to_string(::getppid())));  // a run still going on
  fs::create_directories(folder / "out.partial-notes");
  fs::create_directories(folder / ("other.partial-" + dead));
  make_results(folder / "out", "new");
  EXPECT_THAT(names_in(folder.path()), UnorderedElementsAre("out", "out.partial-" + std::to_string(::getppid()),
                                                            "out.partial-notes", "other.partial-" + dead));
}

TEST(OutputFolder, does_not_clear_away_one_that_is_being_built) {
  const test::TemporaryFolder folder;
  OutputFolder first(folder / "out", false);
  write_file(first.staging() / "a", "x");
  expect_refused(folder / "out", false, "cannot be created");
  EXPECT_TRUE(fs::exists(first.staging() / "a"));
}

TEST(OutputFolder, is_committed_once) {
  const test::TemporaryFolder folder;
  OutputFolder output(folder / "out", false);
  output.commit();
  EXPECT_THROW(output.commit(), ContractViolation);
  EXPECT_THROW(OutputFolder("", false), ContractViolation);
}

TEST(OutputFolder, leaves_a_full_disk_as_it_was) {
  const test::SmallDisk folder;
  if (!folder.is_mounted()) GTEST_SKIP() << "may not mount a small disk here: " << folder.problem();
  make_results(folder / "out", "old");
  {
    OutputFolder output(folder / "out", true);
    EXPECT_THROW(write_file(output.staging() / "map.mwdb", std::string(200'000, 'x')), Error);
  }
  EXPECT_EQ(read_file(folder / "out/manifest.json"), "old");
  EXPECT_THAT(names_in(folder.path()), UnorderedElementsAre("out"));
}

}  // namespace
}  // namespace mapweave
