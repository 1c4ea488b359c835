#include <mapweave/core/error.h>
#include <mapweave/core/mixed_bits.h>
#include <mapweave/mapdb/stored_outbox.h>
#include <support/killed.h>
#include <support/temporary_folder.h>

#include <gmock/gmock.h>
#include <sqlite3.h>
#include <sys/mount.h>

#include <fstream>

namespace mapweave::mapdb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::uint64_t kRoom = 1 << 20;

std::vector<std::string> due(transport::Outbox& outbox) {
  std::vector<std::string> bytes;
  for (const transport::Envelope& one : outbox.take_due()) bytes.push_back(one.sender + ":" + one.bytes);
  return bytes;
}

std::string noise(std::size_t size, std::uint64_t seed) {
  std::string bytes(size, '\0');
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>(mixed(mixed(seed) + i));
  return bytes;
}

class StoredOutboxTest : public testing::Test {
 protected:
  std::optional<Error> error_of(const std::function<void()>& call) {
    try {
      call();
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(".mwo"));
      return error;
    }
    return std::nullopt;
  }
  ErrorCode opening() {
    const auto error = error_of([&] { due(*std::make_unique<StoredOutbox>(path_, kRoom)); });
    return error ? error->code() : ErrorCode::kInternal;
  }
  void change(const char* sql) {
    sqlite3* handle = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &handle), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(handle, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(handle);
    sqlite3_close(handle);
  }

  test::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "a.mwo";
};

TEST_F(StoredOutboxTest, keeps_what_nobody_has_confirmed_over_a_restart) {
  {
    StoredOutbox outbox(path_, kRoom);
    outbox.append({"update", std::string("on\0e", 4), "alpha", 1});
    outbox.append({"view", "", "beta", 5, true});
    outbox.append({"update", "two", "alpha", 2});
    EXPECT_THAT(due(outbox), ElementsAre(std::string("alpha:on\0e", 10), "beta:", "alpha:two"));
    EXPECT_THAT(due(outbox), IsEmpty()) << "they are in flight";
    outbox.repeat("alpha", 2);
    outbox.repeat("gamma", 2);
    EXPECT_THAT(due(outbox), ElementsAre("alpha:two"));
    outbox.forget("alpha", 1);
    outbox.forget("alpha", 1);
    outbox.forget("gamma", 7);
  }
  StoredOutbox again(path_, kRoom);
  EXPECT_GT(again.bytes(), 0U);
  const auto messages = again.take_due();
  ASSERT_EQ(messages.size(), 2U) << "a receiver knows what it has";
  EXPECT_EQ(messages[0].subject, "view");
  EXPECT_EQ(messages[0].sequence, 5U);
  EXPECT_TRUE(messages[0].last_counts);
  EXPECT_EQ(messages[1].bytes, "two");
  EXPECT_EQ(again.last_number("alpha"), 2U);
  EXPECT_EQ(again.last_number("gamma"), 0U);
  again.forget("alpha", 9);
  again.forget("beta", 5);
  EXPECT_EQ(again.bytes(), 0U);
  EXPECT_EQ(again.last_number("alpha"), 2U) << "forgotten, and yet used";
  EXPECT_THROW(again.append({"update", "two", "alpha", 2}), ContractViolation);
  again.append({"update", "three", "alpha", 3});
  again.repeat_all();
  EXPECT_THAT(due(again), ElementsAre("alpha:three"));
}

TEST_F(StoredOutboxTest, has_room_for_so_much_and_hands_it_over_in_pieces) {
  StoredOutbox outbox(path_, 40 << 20);
  std::uint64_t number = 0;
  for (; outbox.has_room(); ++number) outbox.append({"update", noise(3 << 20, number + 1), "alpha", number + 1});
  EXPECT_EQ(number, 14U);
  std::uint64_t next = 1;
  for (auto some = outbox.take_due(); !some.empty(); some = outbox.take_due()) {
    EXPECT_LE(some.size(), 2U);
    for (const transport::Envelope& one : some) {
      EXPECT_EQ(one.sequence, next);
      EXPECT_TRUE(one.bytes == noise(3 << 20, next++));
    }
  }
  EXPECT_EQ(next, 15U);
  outbox.forget("alpha", 1);
  EXPECT_TRUE(outbox.has_room());
}

TEST_F(StoredOutboxTest, loses_nothing_when_its_process_is_killed) {
  std::uint64_t last = 0, first = 1;
  for (int round = 0; round < 6; ++round) {
    const std::size_t count = test::killed(
        [&](int out) {
          StoredOutbox outbox(path_, std::uint64_t{1} << 30);
          for (std::uint64_t number = outbox.last_number("alpha") + 1;; ++number) {
            outbox.append({"update", noise(2000, number), "alpha", number});
            if (write(out, ".", 1) != 1) return;
            if (number % 7 == 0) outbox.forget("alpha", number - 5);
          }
        },
        15, 300 * static_cast<unsigned>(round));
    StoredOutbox outbox(path_, std::uint64_t{1} << 30);
    EXPECT_GE(outbox.last_number("alpha"), last + count) << "what was appended is there";
    EXPECT_LE(outbox.last_number("alpha"), last + count + 1);
    last = outbox.last_number("alpha");
    const auto messages = outbox.take_due();
    ASSERT_FALSE(messages.empty());
    EXPECT_GE(messages.front().sequence, first);
    first = messages.front().sequence;
    EXPECT_EQ(messages.back().sequence, last);
    EXPECT_EQ(messages.size(), last - first + 1) << "without a gap";
    for (const auto& one : messages) EXPECT_TRUE(one.bytes == noise(2000, one.sequence));
  }
}

TEST_F(StoredOutboxTest, says_that_the_disk_is_full_and_goes_on_when_there_is_room) {
  const auto disk = folder_.path() / "disk";
  std::filesystem::create_directory(disk);
  if (mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=1m") != 0)
    GTEST_SKIP() << "needs the right to mount a small tmpfs";
  const auto unmount = [](const std::filesystem::path* one) { umount2(one->c_str(), MNT_DETACH); };
  const std::unique_ptr<const std::filesystem::path, decltype(unmount)> mounted(&disk, unmount);
  {
    StoredOutbox outbox(disk / "a.mwo", std::uint64_t{1} << 30);
    std::uint64_t number = 0;
    std::optional<Error> error;
    while (!error && number < 1000) {
      error = error_of([&] { outbox.append({"update", noise(20'000, number + 1), "alpha", number + 1}); });
      if (!error) ++number;
    }
    ASSERT_TRUE(error);
    EXPECT_EQ(error->code(), ErrorCode::kCannotWrite);
    EXPECT_THAT(error->what(), HasSubstr("the disk is full"));
    EXPECT_EQ(outbox.last_number("alpha"), number);
    const auto messages = outbox.take_due();
    ASSERT_EQ(messages.size(), number);
    for (const auto& one : messages) EXPECT_TRUE(one.bytes == noise(20'000, one.sequence));
    outbox.forget("alpha", number - 2);  // whether it can be written now or later
    outbox.repeat_all();
    EXPECT_EQ(outbox.take_due().size(), 2U);
    ASSERT_EQ(mount("tmpfs", disk.c_str(), "tmpfs", MS_REMOUNT, "size=8m"), 0);
    outbox.append({"update", "more", "alpha", number + 1});
    EXPECT_LT(outbox.bytes(), 50'000U) << "what was forgotten has left the file";
  }
  EXPECT_EQ(StoredOutbox(disk / "a.mwo", kRoom).take_due().size(), 3U);
}

TEST_F(StoredOutboxTest, is_one_process_alone) {
  StoredOutbox outbox(path_, kRoom);
  EXPECT_EQ(opening(), ErrorCode::kBadInput);
}

TEST_F(StoredOutboxTest, refuses_what_is_none_and_what_is_damaged) {
  std::ofstream(path_) << std::string(5000, 'x');
  EXPECT_EQ(opening(), ErrorCode::kCorrupt);
  const auto damaged = [&](const char* sql) {
    std::filesystem::remove(path_);
    StoredOutbox(path_, kRoom).append({"update", noise(3000, 1), "alpha", 1});
    change(sql);
    return opening();
  };
  EXPECT_EQ(damaged("UPDATE messages SET bytes = bytes + 1"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("UPDATE messages SET sequence = 7"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("UPDATE messages SET sha256 = x'00'"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("CREATE TABLE more (x)"), ErrorCode::kCorrupt);
  EXPECT_EQ(damaged("PRAGMA user_version = 7"), ErrorCode::kUnsupported);
  EXPECT_EQ(damaged("PRAGMA application_id = 7"), ErrorCode::kCorrupt);
  path_ = folder_.path() / "nowhere" / "a.mwo";
  EXPECT_EQ(opening(), ErrorCode::kCannotWrite);
}

TEST_F(StoredOutboxTest, hands_over_the_others_where_one_is_damaged) {
  {
    StoredOutbox outbox(path_, kRoom);
    for (std::uint64_t number = 1; number <= 3; ++number) outbox.append({"update", "text", "alpha", number});
  }
  change("UPDATE messages SET zstd = x'00' WHERE sequence = 2");
  StoredOutbox outbox(path_, kRoom);
  const auto error = error_of([&] { outbox.take_due(); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kCorrupt);
  EXPECT_THAT(error->what(), HasSubstr("message 2"));
  EXPECT_EQ(outbox.take_due().size(), 2U);
  outbox.forget("alpha", 3);
  EXPECT_EQ(outbox.bytes(), 0U);
}

}  // namespace
}  // namespace mapweave::mapdb
