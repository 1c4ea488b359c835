#include <gtest/gtest.h>
#include <mapweave/maps/occupancy_grid.h>

#include <cmath>

namespace mapweave {
namespace {

TEST(OccupancyGrid, converts_log_odds_to_probabilities) {
  EXPECT_EQ(probability(OccupancyGrid::kUnknown), 0.5);
  const auto stored = static_cast<std::int16_t>(std::lround(std::log(0.7 / 0.3) * OccupancyGrid::kUnitsPerNat));
  EXPECT_NEAR(probability(stored), 0.7, 0.005);
  EXPECT_NEAR(probability(static_cast<std::int16_t>(-stored)), 0.3, 0.005);
  EXPECT_EQ(probability(32767), 1.0);
  EXPECT_NEAR(probability(-32768), 0.0, 1e-100);
}

}  // namespace
}  // namespace mapweave
