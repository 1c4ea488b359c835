#include <mapweave/tiers/robot_slam.h>

#include <gmock/gmock.h>
#include <support/fake_mapper.h>

namespace mapweave::tiers {
namespace {

using test::FakeMapper;
using test::make_odometry;
using test::make_scan;

const RobotId kAlpha("alpha");

Sensed message(std::uint64_t sequence, StreamEnd end) { return {kAlpha, sequence, {}, std::move(end)}; }
Sensed message(std::uint64_t sequence, const laser::ScanInput& scan) {
  return {kAlpha, sequence, scan.stamp, scan.scan};
}
Sensed message(std::uint64_t sequence, const laser::OdometryInput& odometry) {
  return {kAlpha, sequence, odometry.stamp, odometry.odometry_from_robot};
}

RobotSlam slam(int fails_at_scan = -1) { return {kAlpha, std::make_unique<FakeMapper>(kAlpha, fails_at_scan)}; }

TEST(RobotSlam, answers_with_the_map_when_the_stream_ends) {
  RobotSlam instance = slam();
  EXPECT_FALSE(instance.step(message(1, make_odometry(1.0, 0.0))));
  EXPECT_FALSE(instance.step(message(2, make_scan(1.0))));
  const auto outcome = instance.step(message(3, StreamEnd{}));
  ASSERT_TRUE(outcome);
  ASSERT_TRUE(outcome->map);
  EXPECT_EQ(outcome->map->nodes.size(), 1u);
  EXPECT_FALSE(outcome->trouble);
  EXPECT_FALSE(instance.step(message(4, StreamEnd{})));  // only once
}

TEST(RobotSlam, takes_a_message_that_comes_twice_once) {
  RobotSlam instance = slam();
  for (int times = 0; times < 2; ++times) EXPECT_FALSE(instance.step(message(1, make_scan(1.0))));
  EXPECT_EQ(instance.step(message(2, StreamEnd{}))->map->nodes.size(), 1u);
}

TEST(RobotSlam, goes_on_after_a_scan_that_was_lost) {
  RobotSlam instance = slam();
  EXPECT_FALSE(instance.step(message(1, make_scan(1.0))));
  EXPECT_FALSE(instance.step({kAlpha, 2, {}, LostScan{}}));
  EXPECT_FALSE(instance.step(message(3, make_scan(2.0))));
  const auto outcome = instance.step(message(4, StreamEnd{}));
  ASSERT_TRUE(outcome && outcome->map);
  EXPECT_FALSE(outcome->trouble);
  EXPECT_EQ(outcome->map->nodes.size(), 2u);
}

TEST(RobotSlam, keeps_what_came_before_trouble_and_before_a_gap) {
  RobotSlam cut = slam();
  cut.step(message(1, make_scan(1.0)));
  const auto outcome = cut.step(message(2, StreamEnd{Error(ErrorCode::kCorrupt, "cut short", "a.rawlog at byte 17")}));
  ASSERT_TRUE(outcome && outcome->map && outcome->trouble);
  EXPECT_EQ(outcome->trouble->code(), ErrorCode::kCorrupt);

  RobotSlam gap = slam();
  gap.step(message(1, make_scan(1.0)));
  const auto after = gap.step(message(4, make_scan(2.0)));
  ASSERT_TRUE(after && after->map && after->trouble);
  EXPECT_THAT(after->trouble->what(), testing::HasSubstr("messages 2 to 3 never came"));
}

TEST(RobotSlam, makes_an_engine_that_fails_the_trouble_of_its_robot_alone) {
  RobotSlam instance = slam(1);
  EXPECT_FALSE(instance.step(message(1, make_scan(1.0))));
  const auto outcome = instance.step(message(2, make_scan(2.0)));
  ASSERT_TRUE(outcome && outcome->trouble);
  EXPECT_FALSE(outcome->map);
  EXPECT_EQ(outcome->trouble->code(), ErrorCode::kHelperFailed);
}

TEST(RobotSlam, has_no_map_of_a_stream_that_ends_before_anything_came) {
  RobotSlam instance = slam();
  const auto outcome = instance.step(message(1, StreamEnd{Error(ErrorCode::kBadInput, "no laser")}));
  ASSERT_TRUE(outcome && outcome->trouble);
  EXPECT_FALSE(outcome->map);
}

}  // namespace
}  // namespace mapweave::tiers
