#include "small_disk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <sys/stat.h>

#include <support/temporary_folder.h>
#include <chrono>
#include <fstream>
#include <thread>

namespace mapweave {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

template <class Function>
Error error_of(Function function) {
  try {
    function();
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "nothing was thrown";
  return Error(ErrorCode::kInternal, "nothing was thrown");
}

std::size_t entries_in(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), {}));
}

TEST(WriteFile, writes_what_read_file_reads) {
  const test::TemporaryFolder folder;
  const std::string bytes("\0\r\n\xFF text", 9);
  write_file(folder / "a", bytes);
  EXPECT_EQ(read_file(folder / "a"), bytes);
  write_file(folder / "a", "");
  EXPECT_EQ(read_file(folder / "a"), "");
  const std::string large(300'000, 'y');
  write_file(folder / "a", large);
  EXPECT_EQ(read_file(folder / "a"), large);
  EXPECT_EQ(entries_in(folder.path()), 1u);
}

TEST(WriteFile, leaves_nothing_behind_where_it_cannot_write) {
  const test::TemporaryFolder folder;
  const Error error = error_of([&] { write_file(folder / "absent/a", "x"); });
  EXPECT_EQ(error.code(), ErrorCode::kCannotWrite);
  EXPECT_EQ(error.where(), (folder / "absent/a").string());
  fs::create_directory(folder / "taken");
  write_file(folder / "taken/inside", "x");
  EXPECT_EQ(error_of([&] { write_file(folder / "taken", "x"); }).code(), ErrorCode::kCannotWrite)
      << "a folder is not replaced by a file";
  EXPECT_EQ(entries_in(folder.path()), 1u);
}

TEST(WriteFile, keeps_the_old_file_and_says_what_is_free_when_the_disk_is_full) {
  const test::SmallDisk folder;
  if (!folder.is_mounted()) GTEST_SKIP() << "may not mount a small disk here: " << folder.problem();
  write_file(folder / "map", "old");
  const Error error = error_of([&] { write_file(folder / "map", std::string(200'000, 'x')); });
  EXPECT_EQ(error.code(), ErrorCode::kCannotWrite);
  EXPECT_EQ(error.where(), (folder / "map").string());
  EXPECT_THAT(error.problem(), HasSubstr("cannot write 200000 bytes: No space left on device ("));
  EXPECT_THAT(error.problem(), HasSubstr(" bytes free)"));
  EXPECT_EQ(read_file(folder / "map"), "old");
  EXPECT_EQ(entries_in(folder.path()), 1u);
}

TEST(ReadFile, names_the_file_that_is_missing) {
  const test::TemporaryFolder folder;
  const Error error = error_of([&] { read_file(folder / "absent.yaml"); });
  EXPECT_EQ(error.code(), ErrorCode::kMissing);
  EXPECT_EQ(std::string(error.what()),
            (folder / "absent.yaml").string() + ": cannot be read: No such file or directory; check the path");
  EXPECT_EQ(error_of([&] { read_file(folder.path()); }).code(), ErrorCode::kMissing);
}

TEST(ReadFile, waits_for_a_pipe_only_where_somebody_writes_to_it) {
  const test::TemporaryFolder folder;
  const auto pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(error_of([&] { read_file(pipe); }).what(), HasSubstr("pipe: is a pipe that nobody writes to"));
  std::thread writer([&] {
    std::ofstream late(pipe);
    late << "first";
    late.flush();
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    late << " and last";
  });
  EXPECT_EQ(read_file(pipe), "first and last");
  writer.join();
}

TEST(ExpectOutside, names_a_place_that_cannot_be_found_and_not_the_input) {
  const test::TemporaryFolder folder;
  std::filesystem::create_symlink("round", folder / "round");
  const Error error = error_of([&] { expect_outside(folder / "round", {folder / "room.log"}); });
  EXPECT_EQ(error.code(), ErrorCode::kCannotWrite);
  EXPECT_THAT(error.what(), HasSubstr("symbolic links"));
}

TEST(ReadFile, reads_no_more_than_its_caller_can_hold) {
  const test::TemporaryFolder folder;
  write_file(folder / "a", "12345");
  EXPECT_EQ(read_file(folder / "a", 5), "12345");
  EXPECT_EQ(error_of([&] { read_file(folder / "a", 4); }).code(), ErrorCode::kBadInput);
  EXPECT_EQ(error_of([&] { read_file("/dev/zero", 1'000'000); }).code(), ErrorCode::kBadInput);
}

}  // namespace
}  // namespace mapweave
