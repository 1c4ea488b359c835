#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/stamp.h>

#include <cmath>

namespace mapweave {
namespace {

TEST(Stamp, keeps_the_microseconds_of_a_log) {
  EXPECT_EQ((stamp_from_seconds(976052857.217426).ns + 500) / 1000, 976052857217426);
  EXPECT_EQ(stamp_from_seconds(0.000000001).ns, 1);
  EXPECT_EQ(stamp_from_seconds(1.5).ns, 1'500'000'000);
  EXPECT_EQ(stamp_from_seconds(-1.25).ns, -1'250'000'000);
}

TEST(Stamp, goes_to_seconds_and_back) {
  for (const double seconds : {0.0, 12.125, 976052857.25, -3.5})
    EXPECT_DOUBLE_EQ(stamp_from_seconds(seconds).seconds(), seconds);
  EXPECT_DOUBLE_EQ(seconds_between({1'000'000'000}, {3'500'000'000}), 2.5);
}

TEST(Stamp, refuses_what_is_no_time) {
  EXPECT_THROW(stamp_from_seconds(std::nan("")), ContractViolation);
  EXPECT_THROW(stamp_from_seconds(INFINITY), ContractViolation);
  EXPECT_THROW(stamp_from_seconds(1e10), ContractViolation);
  EXPECT_NO_THROW(stamp_from_seconds(-9e9));
}

}  // namespace
}  // namespace mapweave
