#include <gtest/gtest.h>
#include <mapweave/core/ids.h>

#include <limits>
#include <set>
#include <thread>
#include <vector>

namespace mapweave {
namespace {

const SessionId kSession{{RobotId("alpha"), SensorId("laser")}, 976'052'857'217'426'000};

TEST(Name, of_one_text_is_one_name) {
  EXPECT_EQ(RobotId("alpha"), RobotId(std::string("al") + "pha"));
  EXPECT_NE(RobotId("alpha"), RobotId("beta"));
  EXPECT_EQ(&RobotId("alpha").str(), &RobotId("alpha").str());
  EXPECT_TRUE(RobotId().empty());
  EXPECT_EQ(RobotId(), RobotId(""));
}

TEST(Name, is_ordered_by_its_letters_not_by_its_age) {
  const RobotId late("zulu"), early("able");
  EXPECT_LT(early, late);
  EXPECT_FALSE(late < early);
  EXPECT_FALSE(late < late);
  EXPECT_LT(RobotId(), early);
}

TEST(Name, can_be_made_by_many_threads_at_once) {
  std::vector<std::vector<RobotId>> names(8);
  std::vector<std::thread> threads;
  for (auto& mine : names) {
    threads.emplace_back([&mine] {
      for (int i = 0; i < 500; ++i) mine.emplace_back("robot" + std::to_string(i % 100));
    });
  }
  for (auto& thread : threads) thread.join();
  for (const auto& others : names) EXPECT_EQ(others, names.front());
}

TEST(Ids, are_ordered_by_robot_sensor_run_and_index) {
  const auto node = [](const char* robot, const char* sensor, std::int64_t run, std::uint32_t index) {
    return NodeId{{{RobotId(robot), SensorId(sensor)}, run}, index};
  };
  const std::vector<NodeId> sorted = {node("a", "laser", 5, 9), node("b", "camera", 9, 9), node("b", "laser", 1, 7),
                                      node("b", "laser", 1, 8), node("b", "laser", 2, 0)};
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    for (std::size_t j = 0; j < sorted.size(); ++j) {
      EXPECT_EQ(sorted[i] < sorted[j], i < j);
      EXPECT_EQ(sorted[i] == sorted[j], i == j);
      EXPECT_EQ(sorted[i] != sorted[j], i != j);
    }
  }
}

TEST(Ids, read_as_robot_sensor_and_run) {
  EXPECT_EQ(to_string(kSession), "alpha/laser@976052857.217");
  EXPECT_EQ(to_string(NodeId{kSession, 17}), "alpha/laser@976052857.217/node 17");
  EXPECT_EQ(to_string(SubmapId{kSession, 3}), "alpha/laser@976052857.217/submap 3");
  EXPECT_EQ(to_string(SessionId{kSession.client, -1'005'000'000}), "alpha/laser@-1.005");
  EXPECT_EQ(to_string(SessionId{kSession.client, std::numeric_limits<std::int64_t>::min()}),
            "alpha/laser@-9223372036.854");
}

TEST(ValidName, can_be_a_folder) {
  for (const char* name : {"alpha", "Robot_2", "a", "7", "x-1.y", "-"}) EXPECT_TRUE(is_valid_name(name)) << name;
  for (const char* name : {"", ".", "..", ".hidden", "a/b", "a b", "a\nb", "\xC3\xA4", "a:b"})
    EXPECT_FALSE(is_valid_name(name)) << name;
  EXPECT_TRUE(is_valid_name(std::string(64, 'a')));
  EXPECT_FALSE(is_valid_name(std::string(65, 'a')));
}

}  // namespace
}  // namespace mapweave
