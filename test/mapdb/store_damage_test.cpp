#include <gmock/gmock.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "stored.h"

namespace mapweave::mapdb {
namespace {

using test::RandomMaps;
using test::TemporaryFolder;
using ::testing::HasSubstr;

namespace fs = std::filesystem;

class DamagedStore : public ::testing::Test {
 protected:
  void SetUp() override {
    write_store(path_, some_maps(1, 12));
    bytes_ = read_file(path_);
    identity_ = identity(some_maps(1, 12));
  }

  void put(const std::string& bytes) { std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes; }

  void change(const std::string& sql) {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  void expect_refused(ErrorCode code, const std::string& words) {
    for (const auto& error : {error_of([&] { read_store(path_); }), error_of([&] { summarize_store(path_); })}) {
      ASSERT_TRUE(error) << "expected: " << words;
      EXPECT_EQ(error->code(), code) << error->what();
      EXPECT_THAT(error->what(), HasSubstr(words));
      EXPECT_THAT(error->what(), HasSubstr(path_.string()));
      EXPECT_FALSE(error->remedy().empty());
    }
  }

  // Whatever stands in the file: a clear refusal, or what was written.
  bool is_refused() {
    const auto summary_error = error_of([&] { summarize_store(path_); });
    const auto error = error_of([&] { EXPECT_EQ(identity(read_store(path_)), identity_); });
    EXPECT_TRUE(!error || error->code() == ErrorCode::kCorrupt || error->code() == ErrorCode::kUnsupported)
        << error->what();
    EXPECT_TRUE(error || !summary_error) << summary_error->what();
    return error.has_value();
  }

  TemporaryFolder folder_;
  fs::path path_ = folder_ / "map.mwdb";
  std::string bytes_;
  Hash identity_;
};

TEST_F(DamagedStore, is_noticed_when_cut_at_any_size) {
  for (std::size_t size = 0; size < bytes_.size(); size += size < 120 ? 1 : 307) {
    put(bytes_.substr(0, size));
    EXPECT_TRUE(is_refused()) << size;
  }
  put(bytes_.substr(0, bytes_.size() - 1));
  expect_refused(ErrorCode::kCorrupt, "cut short: it needs " + std::to_string(bytes_.size()) + " bytes, " +
                                          std::to_string(bytes_.size() - 1) + " are there");
}

TEST_F(DamagedStore, is_noticed_or_does_no_harm_when_a_byte_flips) {
  RandomMaps random(5);
  int refused = 0;
  for (int i = 0; i < 800; ++i) {
    std::string damaged = bytes_;
    const std::size_t at = i < 100 ? static_cast<std::size_t>(i) : random.below(bytes_.size());
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << random.below(8)));
    put(damaged);
    refused += is_refused() ? 1 : 0;
  }
  EXPECT_GT(refused, 100) << "much of a small file is empty";
}

TEST_F(DamagedStore, is_noticed_or_does_no_harm_when_pages_are_mixed_up) {
  RandomMaps random(6);
  const std::size_t pages = bytes_.size() / 4096;
  for (int i = 0; i < 200; ++i) {
    std::string damaged = bytes_;
    damaged.replace(4096 * random.below(pages), 4096, bytes_, 4096 * random.below(pages), 4096);
    put(damaged);
    is_refused();
  }
}

TEST_F(DamagedStore, of_a_newer_schema_is_refused_with_both_versions) {
  change("PRAGMA user_version = 7");
  expect_refused(ErrorCode::kUnsupported,
                 "schema 7; this program knows schemas up to 3; read it with a newer mapweave");
}

TEST_F(DamagedStore, of_another_program_is_refused) {
  change("PRAGMA application_id = 1234");
  expect_refused(ErrorCode::kCorrupt, "another program");
}

TEST_F(DamagedStore, with_other_tables_is_refused) {
  change("CREATE VIEW more AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i FROM n) SELECT i FROM n");
  expect_refused(ErrorCode::kCorrupt, "more tables");
}

TEST_F(DamagedStore, with_changed_tables_is_refused) {
  change("UPDATE maps SET nodes = nodes + 1 WHERE place = 1");
  expect_refused(ErrorCode::kCorrupt, "seal");
}

TEST_F(DamagedStore, with_changed_metadata_is_refused) {
  change("UPDATE metadata SET value = 'mapweave 9' WHERE key = 'program'");
  expect_refused(ErrorCode::kCorrupt, "seal");
}

TEST_F(DamagedStore, with_a_missing_blob_is_refused) {
  change("DELETE FROM updates WHERE map = 1");
  expect_refused(ErrorCode::kCorrupt, "seal");
}

TEST_F(DamagedStore, with_a_changed_blob_is_refused) {
  change("UPDATE updates SET zstd = (SELECT zstd FROM updates WHERE map = 0) WHERE map = 1");
  EXPECT_THAT(error_of([&] { read_store(path_); })->what(), HasSubstr("a blob"));
}

TEST_F(DamagedStore, that_is_empty_is_refused) {
  put("");
  expect_refused(ErrorCode::kCorrupt, "it is empty");
}

TEST_F(DamagedStore, that_is_a_picture_is_refused) {
  put("\x89PNG\r\n" + std::string(500, 'x'));
  expect_refused(ErrorCode::kCorrupt, "no SQLite file");
}

TEST_F(DamagedStore, that_is_a_folder_or_not_there_is_refused) {
  fs::remove(path_);
  expect_refused(ErrorCode::kMissing, "does not exist");
  fs::create_directory(path_);
  expect_refused(ErrorCode::kBadInput, "it is a folder");
}

class InterruptedStore : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  fs::path path_ = folder_ / "map.mwdb";
};

TEST_F(InterruptedStore, leaves_the_old_file_when_writing_fails_at_any_size) {
  const StoredMaps old_maps = some_maps(1, 12), new_maps = some_maps(2, 400);
  write_store(path_, new_maps);
  const rlim_t size = fs::file_size(path_);
  write_store(path_, old_maps);
  const std::string before = read_file(path_);
  signal(SIGXFSZ, SIG_IGN);
  rlimit unlimited{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &unlimited), 0);
  for (rlim_t limit = 0; limit < size; limit += 6007) {
    const rlimit limited{limit, unlimited.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limited), 0);
    const auto error = error_of([&] { write_store(path_, new_maps); });
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &unlimited), 0);
    ASSERT_TRUE(error) << limit;
    EXPECT_EQ(error->code(), ErrorCode::kCannotWrite);
    EXPECT_EQ(count_files(folder_.path()), 1U) << "nothing half-written is left";
    ASSERT_TRUE(read_file(path_) == before);
  }
}

TEST_F(InterruptedStore, says_that_the_disk_is_full_and_leaves_nothing) {
  const fs::path disk = folder_ / "disk";
  fs::create_directory(disk);
  if (mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=256k") != 0)
    GTEST_SKIP() << "needs the right to mount a small tmpfs";
  const auto error = error_of([&] { write_store(disk / "map.mwdb", some_maps(1, 6000)); });
  const std::size_t left = count_files(disk);
  const bool fits = !error_of([&] { write_store(disk / "map.mwdb", some_maps(1, 12)); });
  const bool remounted = mount("tmpfs", disk.c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, "size=256k") == 0;
  const bool reads = !error_of([&] { read_store(disk / "map.mwdb"); });
  const auto read_only = error_of([&] { write_store(disk / "map.mwdb", some_maps(1, 12)); });
  umount(disk.c_str());
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kCannotWrite);
  EXPECT_THAT(error->what(),
              ::testing::AllOf(HasSubstr("the disk is full"), HasSubstr("bytes free"), HasSubstr("free some space")));
  EXPECT_EQ(left, 0U);
  EXPECT_TRUE(fits) << "what was half-written had been removed";
  ASSERT_TRUE(remounted);
  EXPECT_TRUE(reads) << "a store is read where nothing can be written";
  ASSERT_TRUE(read_only);
  EXPECT_EQ(read_only->code(), ErrorCode::kCannotWrite);
}

TEST_F(InterruptedStore, is_the_old_one_or_the_new_one_whole_when_the_writer_is_killed) {
  const StoredMaps old_maps = some_maps(1, 12), new_maps = some_maps(2, 600);
  const std::set<Hash> allowed = {identity(old_maps), identity(new_maps)};
  RandomMaps random(8);
  int killed = 0;
  for (int i = 0; i < 15; ++i) {
    write_store(path_, old_maps);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      write_store(path_, new_maps);
      _exit(0);
    }
    usleep(static_cast<useconds_t>(random.below(40000)));
    kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    killed += WIFSIGNALED(status) ? 1 : 0;
    EXPECT_EQ(allowed.count(identity(read_store(path_))), 1U);
  }
  EXPECT_GT(killed, 0);
  fs::remove(path_);
  for (int i = 0; i < 10; ++i) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      write_store(path_, new_maps);
      _exit(0);
    }
    usleep(static_cast<useconds_t>(random.below(20000)));
    kill(child, SIGKILL);
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    if (fs::exists(path_)) {
      EXPECT_EQ(identity(read_store(path_)), identity(new_maps));
      fs::remove(path_);
    }
  }
}

}  // namespace
}  // namespace mapweave::mapdb
