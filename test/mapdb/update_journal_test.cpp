#include <mapweave/core/error.h>
#include <mapweave/mapdb/update_journal.h>
#include <support/temporary_folder.h>

#include <sqlite3.h>

#include <gmock/gmock.h>
#include <fstream>

namespace mapweave::mapdb {
namespace {

SessionId session(const char* robot) { return {{RobotId(robot), SensorId("camera")}, 42}; }

std::vector<std::string> all(UpdateJournal& journal) {
  std::vector<std::string> result;
  journal.replay([&](const JournalEntry& entry) { result.push_back(entry.from.client.robot.str() + ":" + entry.update); });
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

}  // namespace
}  // namespace mapweave::mapdb
