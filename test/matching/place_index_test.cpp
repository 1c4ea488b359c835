#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/matching/place_index.h>

#include <map>
#include <random>

namespace mapweave::matching {
namespace {

constexpr std::size_t kWords = 200;

NodeId keyframe(std::uint32_t index, const char* robot = "alpha") {
  return {{{RobotId(robot), SensorId("camera")}, 7}, index};
}

BagOfWords any_bag(std::mt19937_64& random) {
  std::map<std::uint32_t, int> counts;
  const int features = 5 + static_cast<int>(random() % 40);
  for (int i = 0; i < features; ++i) ++counts[static_cast<std::uint32_t>(random() % kWords)];
  BagOfWords bag;
  for (const auto& [word, count] : counts)
    bag.push_back({word, static_cast<std::uint16_t>(kWholeBag * count / features)});
  return bag;
}

using Bags = std::map<NodeId, BagOfWords>;

std::vector<SimilarPlace> by_brute_force(const Bags& bags, const BagOfWords& query, std::size_t most, int least) {
  std::vector<SimilarPlace> places;
  for (const auto& [id, bag] : bags)
    if (const int score = common_share(query, bag); score >= least) places.push_back({id, score});
  std::stable_sort(places.begin(), places.end(),
                   [](const SimilarPlace& a, const SimilarPlace& b) { return a.score > b.score; });
  if (places.size() > most) places.resize(most);
  return places;
}

void expect_same(const std::vector<SimilarPlace>& a, const std::vector<SimilarPlace>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].id, b[i].id) << i;
    EXPECT_EQ(a[i].score, b[i].score) << i;
  }
}

TEST(PlaceIndex, answers_as_brute_force_does_while_keyframes_come_and_go) {
  std::mt19937_64 random(4);
  PlaceIndex index(kWords);
  Bags bags;
  for (int step = 0; step < 1500; ++step) {
    const NodeId id = keyframe(static_cast<std::uint32_t>(random() % 400), random() % 2 ? "alpha" : "beta");
    if (bags.count(id) > 0) {
      EXPECT_TRUE(index.remove(id));
      bags.erase(id);
    } else {
      bags[id] = any_bag(random);
      index.add(id, bags[id]);
    }
    EXPECT_EQ(index.size(), bags.size());
    if (step % 25 != 0) continue;
    const BagOfWords query = any_bag(random);
    expect_same(index.query(query, 12), by_brute_force(bags, query, 12, 1));
    expect_same(index.query(query, 1000, {}, 9000), by_brute_force(bags, query, 1000, 9000));
  }
  while (!bags.empty()) {
    index.remove(bags.begin()->first);
    bags.erase(bags.begin());
  }
  EXPECT_TRUE(index.query(any_bag(random), 10).empty());
  EXPECT_FALSE(index.remove(keyframe(0)));
}

TEST(PlaceIndex, orders_equal_scores_by_id_whatever_the_order_of_coming) {
  const BagOfWords bag = {{3, 30000}, {9, 35000}};
  PlaceIndex rising(kWords), falling(kWords);
  for (std::uint32_t i = 0; i < 9; ++i) {
    rising.add(keyframe(i), bag);
    falling.add(keyframe(8 - i), bag);
  }
  expect_same(rising.query(bag, 4), falling.query(bag, 4));
  EXPECT_EQ(rising.query(bag, 4).back().id, keyframe(3));
  EXPECT_EQ(rising.query(bag, 4).back().score, 65000);
}

TEST(PlaceIndex, passes_over_what_is_excluded) {
  PlaceIndex index(kWords);
  const BagOfWords bag = {{3, 65535}};
  for (std::uint32_t i = 0; i < 6; ++i) index.add(keyframe(i), bag);
  const auto places = index.query(bag, 2, [](const NodeId& id) { return id.index < 3; });
  ASSERT_EQ(places.size(), 2U);
  EXPECT_EQ(places[0].id, keyframe(3));
  EXPECT_EQ(places[1].id, keyframe(4));
}

TEST(PlaceIndex, refuses_a_keyframe_twice_and_words_it_does_not_know) {
  PlaceIndex index(kWords);
  index.add(keyframe(1), {{3, 65535}});
  EXPECT_THROW(index.add(keyframe(1), {{4, 65535}}), ContractViolation);
  EXPECT_THROW(index.add(keyframe(2), {{kWords, 65535}}), ContractViolation);
  EXPECT_THROW(index.query({{kWords, 65535}}, 1), ContractViolation);
  EXPECT_THROW(index.query({{3, 65535}, {4, 1}}, 1), ContractViolation);  // more than a whole
  EXPECT_THROW(index.query({{4, 5}, {4, 5}}, 1), ContractViolation);
  EXPECT_EQ(index.size(), 1U);
}

TEST(PlaceIndex, takes_little_memory) {
  std::mt19937_64 random(4);
  PlaceIndex index(kWords);
  std::size_t words = 0;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const BagOfWords bag = any_bag(random);
    words += bag.size();
    index.add(keyframe(i), bag);
  }
  EXPECT_LT(index.bytes(), 8 * words + 200 * 2000);
}

TEST(BestOfGroups, lets_covisible_keyframes_speak_for_each_other) {
  // 1, 2, 3 see each other; 9 stands alone with the best single score.
  const std::vector<SimilarPlace> places = {
      {keyframe(9), 500}, {keyframe(2), 400}, {keyframe(1), 300}, {keyframe(3), 200}};
  const auto covisible = [](const NodeId& id) {
    std::vector<NodeId> others;
    if (id.index <= 3) others = {keyframe(1), keyframe(2), keyframe(3), keyframe(4)};
    return others;
  };
  const auto close = best_of_groups(places, covisible, 0.75);
  ASSERT_EQ(close.size(), 1U);
  EXPECT_EQ(close[0].id, keyframe(2));
  EXPECT_EQ(close[0].score, 900);
  EXPECT_EQ(best_of_groups(places, covisible, 0.5).size(), 2U);
  EXPECT_TRUE(best_of_groups({}, covisible).empty());
}

}  // namespace
}  // namespace mapweave::matching
