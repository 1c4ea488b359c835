#include <mapweave/tiers/update_inbox.h>

#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <support/random_map.h>

#include <atomic>
#include <mutex>
#include <thread>

namespace mapweave::tiers {
namespace {

std::string bytes_of(const Map& map) { return encode(difference(Map{}, map)); }

// A map that grows by a keyframe and what that sees, an update each, and now and then loses an old one.
class InboxTest : public ::testing::Test {
 protected:
  static constexpr std::uint32_t kKeyframes = 40;

  InboxTest() {
    states_.push_back(inbox_.map());
    test::RandomMaps random(3);
    const Map whole = random.keyframe_map("alpha", kKeyframes);
    const SessionId session = whole.nodes.front().first.session;
    for (std::uint32_t count = 1; count <= kKeyframes; ++count) {
      const std::uint32_t begin = count / 4;
      const auto is_there = [&](const NodeId& id) { return id.index >= begin && id.index < count; };
      Map state;
      state.id = whole.id;
      for (std::uint32_t i = begin; i < count; ++i) state.nodes.set({session, i}, *whole.nodes.find({session, i}));
      state.nodes.begin()->second.map_from_node = random.pose();
      for (const auto& [id, constraint] : whole.constraints)
        if (is_there(id.from) && is_there(id.to)) state.constraints.set(id, constraint);
      for (const auto& [id, landmark] : whole.landmarks) {
        if (!is_there(landmark.anchor)) continue;
        Landmark seen = landmark;
        seen.seen.erase(
            std::remove_if(seen.seen.begin(), seen.seen.end(), [&](const auto& s) { return !is_there(s.node); }),
            seen.seen.end());
        state.landmarks.set(id, seen);
      }
      MapUpdate update = difference(states_.back(), state);
      update.origin = origin_;
      update.base = states_.size() - 1;
      update.sequence = states_.size();
      removed_ += update.removed_nodes.size();
      updates_.push_back(std::move(update));
      states_.push_back(std::move(state));
    }
  }
  void take(std::size_t number) { inbox_.receive(updates_.at(number), 100, "test"); }  // counts from 0

  Origin origin_{TierId("edge"), MapId("alpha")};
  std::vector<Map> states_;  // after so many updates
  std::vector<MapUpdate> updates_;
  std::size_t removed_ = 0;
  UpdateInbox inbox_{origin_};
};

TEST_F(InboxTest, holds_what_was_published_after_each_update) {
  EXPECT_GT(removed_, 5U);
  for (std::size_t i = 0; i < updates_.size(); ++i) {
    take(i);
    ASSERT_EQ(bytes_of(inbox_.map()), bytes_of(states_[i + 1])) << i;
  }
}

TEST_F(InboxTest, changes_its_map_where_it_lies_unless_somebody_holds_it) {
  take(0);
  const Map* where = &inbox_.map();
  take(1);
  take(2);
  EXPECT_EQ(&inbox_.map(), where);
  auto snapshot = inbox_.snapshot();
  EXPECT_EQ(snapshot.get(), where) << "nothing is copied before it must";
  take(3);
  EXPECT_NE(&inbox_.map(), where);
  where = &inbox_.map();
  take(4);
  EXPECT_EQ(&inbox_.map(), where) << "the copy is nobody else's";
  snapshot = inbox_.snapshot();
  snapshot.reset();
  take(5);
  EXPECT_EQ(&inbox_.map(), where) << "held no longer";
}

TEST_F(InboxTest, leaves_a_snapshot_as_it_was_when_it_was_taken) {
  std::vector<std::shared_ptr<const Map>> snapshots;
  for (std::size_t i = 0; i < updates_.size(); ++i) {
    if (i % 3 == 0) snapshots.push_back(inbox_.snapshot());
    if (i % 9 == 5) snapshots.push_back(snapshots.back());
    take(i);
  }
  for (std::size_t i = 0, at = 0; i < updates_.size(); ++i) {
    if (i % 3 == 0) {
      EXPECT_EQ(bytes_of(*snapshots[at++]), bytes_of(states_[i])) << i;
    }
    at += i % 9 == 5;
  }
}

TEST_F(InboxTest, keeps_its_map_and_its_count_where_an_update_does_not_fit) {
  for (std::size_t i = 0; i < 20; ++i) take(i);
  MapUpdate bad = updates_[20];
  bad.landmarks.back().seen.back().node.index = 999;
  for (const bool is_held : {false, true}) {
    const auto snapshot = is_held ? inbox_.snapshot() : nullptr;
    EXPECT_THROW(inbox_.receive(bad, 100, "test"), Error);
    EXPECT_EQ(bytes_of(inbox_.map()), bytes_of(states_[20]));
    EXPECT_EQ(inbox_.receipt().stored, 20U);
  }
  MapUpdate all = difference(Map{}, states_[30]);
  all.origin = origin_;
  all.sequence = 21;
  MapUpdate bad_all = all;
  bad_all.landmarks.back().anchor.index = 999;
  EXPECT_THROW(inbox_.receive(bad_all, 100, "test"), Error);
  EXPECT_EQ(bytes_of(inbox_.map()), bytes_of(states_[20]));
  for (std::size_t i = 20; i < 30; ++i) take(i);
  EXPECT_EQ(bytes_of(inbox_.map()), bytes_of(states_[30]));
}

TEST_F(InboxTest, goes_on_from_an_update_that_says_all) {
  for (std::size_t i = 0; i < 10; ++i) take(i);
  MapUpdate all = difference(Map{}, states_[30]);
  all.origin = origin_;
  all.sequence = 30;
  const auto before = inbox_.snapshot();
  inbox_.receive(all, 100, "test");
  EXPECT_EQ(bytes_of(*before), bytes_of(states_[10]));
  for (std::size_t i = 30; i < updates_.size(); ++i) take(i);
  EXPECT_EQ(bytes_of(inbox_.map()), bytes_of(states_.back()));
}

TEST_F(InboxTest, lets_others_read_what_they_hold_while_updates_come) {
  std::mutex mutex;  // the server's
  std::atomic<bool> ended{false};
  std::atomic<std::size_t> read{0}, wrong{0};
  std::vector<std::string> bytes;
  for (const Map& state : states_) bytes.push_back(bytes_of(state));
  std::vector<std::thread> readers;
  for (int reader = 0; reader < 2; ++reader)
    readers.emplace_back([&] {
      while (!ended) {
        std::shared_ptr<const Map> map;
        std::size_t number = 0;
        {
          const std::lock_guard lock(mutex);
          map = inbox_.snapshot();
          number = inbox_.receipt().stored;
        }
        wrong.fetch_add(bytes_of(*map) != bytes[number], std::memory_order_relaxed);
        map.reset();
        read.fetch_add(
            1, std::memory_order_relaxed);  // so that nothing but the snapshot orders what was read before what comes
      }
    });
  for (std::size_t i = 0; i < updates_.size(); ++i) {
    for (const std::size_t before = read; read.load(std::memory_order_relaxed) < before + 2;) std::this_thread::yield();
    const std::lock_guard lock(mutex);
    take(i);
  }
  ended = true;
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(wrong, 0U);
}

}  // namespace
}  // namespace mapweave::tiers
