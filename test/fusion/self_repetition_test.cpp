#include <gtest/gtest.h>
#include <laser/self_repetition.h>

namespace mapweave::fusion {
namespace {

WallAgreement walls(double coinciding_m, double contradicted_m) {
  WallAgreement result;
  result.coinciding_m = coinciding_m;
  result.contradicted_m = contradicted_m;
  return result;
}

TEST(SelfRepetition, counts_a_second_place_that_fits_nearly_as_well) {
  EXPECT_FALSE(is_contradicted(walls(128.0, 3.3), walls(147.0, 3.5)));
  EXPECT_FALSE(is_contradicted(walls(90.0, 0.0), walls(140.0, 0.0)));
}

TEST(SelfRepetition, leaves_out_a_second_place_that_the_rest_of_the_maps_contradicts) {
  EXPECT_TRUE(is_contradicted(walls(200.0, 17.6), walls(270.0, 1.0)));
  EXPECT_TRUE(is_contradicted(walls(246.0, 66.5), walls(291.0, 1.4)));
}

TEST(SelfRepetition, allows_more_where_the_place_itself_is_contradicted) {
  EXPECT_TRUE(is_contradicted(walls(100.0, 9.0), walls(100.0, 0.0)));
  EXPECT_FALSE(is_contradicted(walls(100.0, 9.0), walls(100.0, 8.0)));
  EXPECT_TRUE(is_contradicted(walls(100.0, 11.0), walls(100.0, 30.0))) << "but never much more";
}

}  // namespace
}  // namespace mapweave::fusion
