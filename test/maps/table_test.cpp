#include <mapweave/maps/table.h>

#include <gmock/gmock.h>

#include <map>
#include <random>
#include <string>

namespace mapweave {
namespace {

using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::Pair;
using Names = Table<int, std::string>;

std::vector<Names::Entry> all(const Names& table) { return {table.begin(), table.end()}; }

Names table_of(const std::vector<int>& keys) {
  Names table;
  for (const int key : keys) table.set(key, std::to_string(key));
  return table;
}

TEST(Table, takes_many_keys_between_before_and_behind_those_it_has) {
  Names table = table_of({2, 4, 6});
  table.set_all({{1, "a"}, {4, "b"}, {5, "c"}, {9, "d"}});
  EXPECT_THAT(all(table),
              ElementsAre(Pair(1, "a"), Pair(2, "2"), Pair(4, "b"), Pair(5, "c"), Pair(6, "6"), Pair(9, "d")));
}

TEST(Table, loses_many_keys_and_overlooks_those_it_does_not_have) {
  Names table = table_of({1, 2, 3, 4, 5, 6});
  table.erase_all({0, 1, 3, 4, 6, 9});
  EXPECT_THAT(all(table), ElementsAre(Pair(2, "2"), Pair(5, "5")));
  table.erase_all({});
  table.erase_all({7});
  EXPECT_EQ(table.size(), 2U);
  table.erase_all({2, 5});
  EXPECT_TRUE(table.empty());
}

TEST(Table, changed_in_many_places_is_as_if_they_were_changed_one_by_one) {
  std::mt19937_64 random(1);
  Names table;
  std::map<int, std::string> expected;
  for (int round = 0; round < 200; ++round) {
    std::map<int, std::string> brought;
    for (auto count = random() % 9; count > 0; --count)
      brought[static_cast<int>(random() % 60)] = std::to_string(random());
    std::vector<int> removed;
    for (int key = 0; key < 60; ++key)
      if (random() % 8 == 0) removed.push_back(key);
    for (const int key : removed) expected.erase(key);
    for (const auto& [key, value] : brought) expected[key] = value;
    table.erase_all(removed);
    table.make_room(brought.size());
    table.set_all({brought.begin(), brought.end()});
    ASSERT_THAT(all(table), ElementsAreArray(std::vector<Names::Entry>(expected.begin(), expected.end()))) << round;
  }
}

TEST(Table, moves_nothing_where_keys_are_known_or_come_last) {
  Names table = table_of({1, 2, 3});
  table.make_room(2);
  const std::string* before = table.find(1);
  table.set_all({{2, "b"}, {7, "g"}, {8, "h"}});
  EXPECT_EQ(table.find(1), before) << "there was room";
  EXPECT_THAT(all(table), ElementsAre(Pair(1, "1"), Pair(2, "b"), Pair(3, "3"), Pair(7, "g"), Pair(8, "h")));
}

}  // namespace
}  // namespace mapweave
