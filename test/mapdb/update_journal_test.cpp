#include <mapweave/core/error.h>
#include <mapweave/mapdb/update_journal.h>
#include <support/killed.h>
#include <support/temporary_folder.h>

#include <sqlite3.h>

#include <gmock/gmock.h>
#include <fstream>

namespace mapweave::mapdb {
namespace {

SessionId session(const char* robot) { return {{RobotId(robot), SensorId("camera")}, 42}; }

std::vector<std::string> all(UpdateJournal& journal) {
  std::vector<std::string> result;
  journal.replay(
      [&](const JournalEntry& entry) { result.push_back(entry.from.client.robot.str() + ":" + entry.update); });
  return result;
}

ErrorCode code_of(const std::filesystem::path& path) {
  try {
    UpdateJournal journal(path);
    all(journal);
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos) << error.what();
    return error.code();
  }
  return ErrorCode::kInternal;
}

TEST(UpdateJournal, gives_back_what_was_appended_in_order) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "a.mwj";
  {
    UpdateJournal journal(path);
    EXPECT_THAT(all(journal), testing::IsEmpty());
    journal.append({{session("beta"), "one"}, {session("alpha"), std::string("t\0wo", 5)}});
    journal.append({{session("beta"), ""}});
  }
  UpdateJournal again(path);
  EXPECT_THAT(all(again), testing::ElementsAre("beta:one", std::string("alpha:t\0wo", 11), "beta:"));
  again.replace({{session("alpha"), "all"}});
  again.append({{session("alpha"), "more"}});
  EXPECT_THAT(all(again), testing::ElementsAre("alpha:all", "alpha:more"));
}

TEST(UpdateJournal, gives_back_each_veto_once_and_before_all_updates) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "a.mwj";
  const Hash one = hash_of_bytes("one"), two = hash_of_bytes("two");
  const auto vetoes = [](UpdateJournal& journal) {
    std::vector<Hash> result;
    std::size_t updates = 0;
    journal.replay([&](const JournalEntry& entry) {
      if (!entry.vetoed) return void(++updates);
      EXPECT_EQ(updates, 0U);
      result.push_back(*entry.vetoed);
    });
    return result;
  };
  {
    UpdateJournal journal(path);
    journal.append({{session("beta"), "one"}, {{}, {}, one}, {{}, {}, two}});
    journal.append({{{}, {}, one}});
  }
  UpdateJournal again(path);
  EXPECT_THAT(vetoes(again), testing::UnorderedElementsAre(one, two));
  again.replace({{session("beta"), "all"}, {{}, {}, two}});
  EXPECT_THAT(vetoes(again), testing::ElementsAre(two));
}

void run_in(const std::filesystem::path& path, const char* sql) {
  sqlite3* handle = nullptr;
  EXPECT_EQ(sqlite3_open(path.c_str(), &handle), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(handle, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(handle);
  sqlite3_close(handle);
}

TEST(UpdateJournal, goes_on_with_one_from_before_there_were_vetoes) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "a.mwj";
  UpdateJournal(path).append({{session("alpha"), "one"}});
  run_in(path, "DROP TABLE vetoes; PRAGMA user_version = 1");
  {
    UpdateJournal journal(path);
    EXPECT_THAT(all(journal), testing::ElementsAre("alpha:one"));
    journal.append({{{}, {}, hash_of_bytes("veto")}, {session("alpha"), "two"}});
  }
  UpdateJournal again(path);
  std::size_t entries = 0;
  again.replay([&](const JournalEntry&) { ++entries; });
  EXPECT_EQ(entries, 3U);
}

TEST(UpdateJournal, is_one_process_alone) {
  const test::TemporaryFolder folder;
  UpdateJournal journal(folder.path() / "a.mwj");
  EXPECT_EQ(code_of(folder.path() / "a.mwj"), ErrorCode::kBadInput);
}

TEST(UpdateJournal, refuses_what_is_none_and_what_is_damaged) {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "text.mwj") << std::string(5000, 'x');
  EXPECT_EQ(code_of(folder.path() / "text.mwj"), ErrorCode::kCorrupt);
  EXPECT_EQ(code_of(folder.path() / "nowhere" / "a.mwj"), ErrorCode::kCannotWrite);
  const auto damage = [&](const char* name, const char* sql) {
    const auto path = folder.path() / name;
    UpdateJournal(path).append({{session("alpha"), std::string(2000, 'a') + "b"}});
    run_in(path, sql);
    return code_of(path);
  };
  EXPECT_EQ(damage("hash.mwj", "UPDATE updates SET bytes = bytes + 1"), ErrorCode::kCorrupt);
  EXPECT_EQ(damage("name.mwj", "UPDATE updates SET robot = '../x'"), ErrorCode::kCorrupt);
  EXPECT_EQ(damage("table.mwj", "CREATE TABLE more (x)"), ErrorCode::kCorrupt);
  EXPECT_EQ(damage("veto.mwj", "INSERT INTO vetoes VALUES (x'0102')"), ErrorCode::kCorrupt);
  EXPECT_EQ(damage("newer.mwj", "PRAGMA user_version = 7"), ErrorCode::kUnsupported);
  EXPECT_EQ(damage("other.mwj", "PRAGMA application_id = 7"), ErrorCode::kCorrupt);
}

TEST(UpdateJournal, makes_no_room_for_what_so_few_bytes_cannot_hold) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "large.mwj";
  UpdateJournal(path).append({{session("alpha"), "small"}});
  // The head of a zstd frame of 1 GiB, which the column beside it says too, and an empty block.
  run_in(path, "UPDATE updates SET bytes = 1073741824, zstd = x'28b52ffde00000004000000000010000'");
  try {
    UpdateJournal journal(path);
    all(journal);
    ADD_FAILURE() << "it was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    EXPECT_NE(std::string(error.what()).find("does not hold the 1073741824 bytes"), std::string::npos) << error.what();
  }
}

// As code_of, of one that is only read.
ErrorCode code_of_left(const std::filesystem::path& path) {
  try {
    UpdateJournal journal = UpdateJournal::left_behind(path);
    all(journal);
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos) << error.what();
    return error.code();
  }
  return ErrorCode::kInternal;
}

std::size_t files_in(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(UpdateJournalLeftBehind, is_read_and_stays_as_it_was) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "a.mwj";
  UpdateJournal(path).append({{session("beta"), "one"}, {session("alpha"), "two"}});
  const auto bytes = std::filesystem::file_size(path);
  std::filesystem::permissions(folder.path(), std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  {
    UpdateJournal journal = UpdateJournal::left_behind(path);
    EXPECT_THAT(all(journal), testing::ElementsAre("beta:one", "alpha:two"));
    EXPECT_EQ(files_in(folder.path()), 1U);
  }
  std::filesystem::permissions(folder.path(), std::filesystem::perms::owner_all);
  EXPECT_EQ(files_in(folder.path()), 1U);
  EXPECT_EQ(std::filesystem::file_size(path), bytes);
}

TEST(UpdateJournalLeftBehind, holds_what_a_killed_server_left_in_its_log) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "a.mwj";
  const auto append = [&](int out) {
    UpdateJournal journal(path);
    for (const char* update : {"one", "two"}) {
      journal.append({{session("alpha"), update}});
      if (write(out, ".", 1) != 1) return;
    }
    pause();
  };
  ASSERT_EQ(test::killed(append, 2, 0), 2U);
  EXPECT_EQ(UpdateJournal::files_of(path).size(), 2U);
  const std::size_t files = files_in(folder.path());
  for (int time = 0; time < 2; ++time) {
    UpdateJournal journal = UpdateJournal::left_behind(path);
    EXPECT_THAT(all(journal), testing::ElementsAre("alpha:one", "alpha:two"));
    EXPECT_EQ(files_in(folder.path()), files);
  }
  UpdateJournal again(path);
  EXPECT_THAT(all(again), testing::ElementsAre("alpha:one", "alpha:two"));
}

TEST(UpdateJournalLeftBehind, is_refused_where_it_is_open_missing_cut_or_none) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "a.mwj";
  {
    UpdateJournal open(path);
    EXPECT_EQ(code_of_left(path), ErrorCode::kBadInput);
  }
  EXPECT_EQ(code_of_left(folder.path() / "absent.mwj"), ErrorCode::kMissing);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "absent.mwj"));
  std::filesystem::create_directory(folder.path() / "folder.mwj");
  EXPECT_EQ(code_of_left(folder.path() / "folder.mwj"), ErrorCode::kBadInput);
  for (const char* content : {"", "xxx"}) {
    std::ofstream(folder.path() / "text.mwj") << content;
    EXPECT_EQ(code_of_left(folder.path() / "text.mwj"), ErrorCode::kCorrupt);
  }
  std::string noise(30000, 'a');
  for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = static_cast<char>((i * i * 2654435761U) >> 13);
  UpdateJournal(path).append({{session("alpha"), noise}});
  const auto bytes = std::filesystem::file_size(path);
  for (const std::uintmax_t left : {bytes - 1, bytes / 2, std::uintmax_t{101}, std::uintmax_t{50}}) {
    std::filesystem::resize_file(path, left);
    EXPECT_EQ(code_of_left(path), ErrorCode::kCorrupt) << left;
  }
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open((folder.path() / "other.mwj").c_str(), &other), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(other, "CREATE TABLE songs (x)", nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(other);
  EXPECT_EQ(code_of_left(folder.path() / "other.mwj"), ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace mapweave::mapdb
