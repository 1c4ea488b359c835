#include "logs.h"

#include <limits>

namespace mapweave::rawlog {
namespace {

using test::TemporaryFolder;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pointwise;

Reading reading_of(const std::vector<Object>& objects, const ReadOptions& options = {}) {
  const TemporaryFolder folder;
  return read_all(write_rawlog(folder / "a.rawlog", objects), options);
}

TEST(Ordering, sorts_sensors_that_come_a_little_late) {
  const auto reading = reading_of({scan(1.0), odometry(0.7), scan(2.0), odometry(1.6), odometry(1.5), scan(3.0)});
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_THAT(seconds(reading.records), Pointwise(DoubleNear(1e-9), {0.7, 1.0, 1.5, 1.6, 2.0, 3.0}));
}

TEST(Ordering, puts_odometry_before_scans_of_the_same_stamp_and_else_keeps_the_order_of_the_file) {
  auto first = scan(1.0), second = scan(1.0);
  first->sensorLabel = "Z";
  second->sensorLabel = "A";
  const auto reading = reading_of({first, second, odometry(1.0), scan(2.0)});
  ASSERT_EQ(kinds(reading.records), "osss");
  EXPECT_EQ(reading.records[1].observation->sensorLabel, "Z");
  EXPECT_EQ(reading.records[2].observation->sensorLabel, "A");
}

TEST(Ordering, refuses_time_that_runs_backwards_after_giving_what_was_good) {
  const auto reading = reading_of({scan(10.0), scan(12.0), scan(11.0), scan(13.0)});
  EXPECT_THAT(seconds(reading.records), ElementsAre(10.0, 12.0));
  EXPECT_THAT(reading.error, IsError(ErrorCode::kBadInput, "time runs backwards"));
  EXPECT_THAT(reading.error->what(), HasSubstr("11.000000"));
  EXPECT_THAT(reading.error->what(), HasSubstr("12.000000"));
  EXPECT_THAT(reading.error->where(), HasSubstr("record 3"));
  EXPECT_THAT(reading.error->where(), HasSubstr("a.rawlog at byte "));
  EXPECT_FALSE(reading.error->remedy().empty());
}

TEST(Ordering, has_a_window_that_can_be_set) {
  ReadOptions wide, none;
  wide.reorder_window_s = 2.0;
  none.reorder_window_s = 0.0;
  EXPECT_THAT(seconds(reading_of({scan(10.0), scan(12.0), scan(11.0)}, wide).records), ElementsAre(10.0, 11.0, 12.0));
  EXPECT_THAT(reading_of({scan(10.0), scan(9.9999)}, none).error, IsError(ErrorCode::kBadInput, "backwards"));
  EXPECT_EQ(kinds(reading_of({scan(10.0), odometry(10.0), scan(11.0)}, none).records), "oss");
}

TEST(Ordering, refuses_scans_that_mean_nothing) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto with_nan = reading_of({scan(1.0), scan(2.0, {1.0f, nan, 3.0f})});
  EXPECT_EQ(with_nan.records.size(), 1u);
  EXPECT_THAT(with_nan.error, IsError(ErrorCode::kBadInput, "ray 1 of a scan of 'LASER' is not a number"));
  EXPECT_THAT(reading_of({scan(1.0), scan(2.0, {})}).error, IsError(ErrorCode::kBadInput, "no rays"));
  EXPECT_THAT(reading_of({odometry(1.0, nan)}).error, IsError(ErrorCode::kBadInput, "odometry"));
}

TEST(Ordering, takes_infinite_ranges_and_invalid_nan_as_no_return) {
  const float infinite = std::numeric_limits<float>::infinity();
  auto mixed = scan(1.0, {1.0f, infinite, std::numeric_limits<float>::quiet_NaN()});
  mixed->setScanRangeValidity(2, false);
  const auto reading = reading_of({mixed});
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_TRUE(scan_of(reading.records[0]).getScanRangeValidity(0));
  EXPECT_FALSE(scan_of(reading.records[0]).getScanRangeValidity(1));
  EXPECT_FALSE(scan_of(reading.records[0]).getScanRangeValidity(2));
}

}  // namespace
}  // namespace mapweave::rawlog
