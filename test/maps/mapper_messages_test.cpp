#include "damage.h"

#include <mapweave/maps/mapper_messages.h>

#include <gmock/gmock.h>
#include <limits>

namespace mapweave {
namespace {

const double kNone = std::numeric_limits<double>::quiet_NaN();

TEST(MapperMessages, come_back_as_they_were) {
  const EngineStart start{"rbpf", {{"particles", 4.0}, {"shrink", 0.8}}};
  const auto begun = std::get<EngineStart>(decode_mapper_input(encode(start), "test"));
  EXPECT_EQ(begun.engine, "rbpf");
  ASSERT_EQ(begun.options.size(), 2U);
  EXPECT_EQ(begun.options[1].name, "shrink");
  EXPECT_EQ(begun.options[1].value, 0.8);
  const Sensed odometry{RobotId("alpha"), 3, {7}, Pose3{{1.0, -2.0, 0.0}, Eigen::Quaterniond::Identity()}};
  const auto sensed = std::get<Sensed>(decode_mapper_input(encode(odometry), "test"));
  EXPECT_EQ(sensed.sequence, 3U);
  EXPECT_EQ(std::get<Pose3>(sensed.body).t.y(), -2.0);
  EXPECT_EQ(std::get<MapperProgress>(decode_mapper_output(encode(MapperProgress{57}), "test")).scans, 57U);
  const ScanPoses poses{{{{1, 2, 3}, {-0.0, 0.1, 6}, true}, {{7, 8, 9}, {10, 11, 12}, false}}, true};
  const auto back = std::get<ScanPoses>(decode_mapper_output(encode(poses), "test"));
  ASSERT_EQ(back.poses.size(), 2U);
  EXPECT_EQ(back.poses[0].previous_from_this.y, 0.1);
  EXPECT_TRUE(back.poses[0].by_wheels);
  EXPECT_FALSE(back.poses[1].by_wheels);
  EXPECT_EQ(back.poses[1].previous_from_this.phi, 12.0);
  EXPECT_TRUE(back.is_last);
  const Refusal failed{Error(ErrorCode::kHelperFailed, "memory_limit_mb reached")};
  EXPECT_EQ(std::get<Refusal>(decode_mapper_output(encode(failed), "test")).why.problem(), "memory_limit_mb reached");
}

TEST(MapperMessages, refuse_what_cannot_be) {
  EXPECT_THROW(encode(EngineStart{"icp", {{"shrink", kNone}}}), ContractViolation);
  EXPECT_THROW(encode(ScanPoses{{{{kNone, 0, 0}, {}, true}}, true}), ContractViolation);
  EXPECT_THROW(decode_mapper_input(encode(MapperProgress{1}), "test"), Error);
  EXPECT_THROW(decode_mapper_output(encode(EngineStart{"icp", {}}), "test"), Error);
  const auto input = [](const std::string& bytes) { return decode_mapper_input(bytes, "test"); };
  const auto output = [](const std::string& bytes) { return decode_mapper_output(bytes, "test"); };
  EXPECT_GT(test::refused_of_damaged(encode(EngineStart{"rbpf", {{"particles", 4.0}, {"shrink", 0.8}}}), input), 50);
  EXPECT_GT(test::refused_of_damaged(encode(ScanPoses{{{{1, 2, 3}, {4, 5, 6}, true}}, true}), output), 50);
  EXPECT_GT(test::refused_of_damaged(encode(MapperProgress{57}), output), 5);
}

}  // namespace
}  // namespace mapweave
