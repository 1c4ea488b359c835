#include "placed.h"

#include <gtest/gtest.h>
#include <laser/laser_team.h>
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

// One robot's map, and the same map laid so many rooms farther along the row: what of it stands elsewhere.
std::vector<Repetition> repetitions_of_rooms(int rooms, int farther) {
  simulation::RoomRowOptions row;
  row.rooms = rooms;
  simulation::TeamOptions options;
  options.robots = 1;
  const auto team = simulation::make_repeated_rooms(row, options);
  const Placed placed(team.robots[0], team.laser);
  std::vector<std::shared_ptr<const WallSight>> sights;
  for (int copy = 0; copy < 2; ++copy)
    for (const auto& model : placed.models()) sights.push_back(std::make_shared<const WallSight>(*model));
  const Pose2 world_from_map = team.robots[0].steps.front().world_from_robot;
  const Pose2 shifted =
      compose(inverse(world_from_map), compose(Pose2{farther * row.room_width_m, 0.0, 0.0}, world_from_map));
  return self_repetitions(placed.at({}, 0), placed.at(shifted, placed.models().size()),
                          [&](std::size_t number) { return sights.at(number); });
}

TEST(SelfRepetition, is_seen_of_one_room_and_of_many) {
  for (const int rooms : {4, 14}) {
    const auto found = repetitions_of_rooms(rooms, 1);
    ASSERT_FALSE(found.empty()) << rooms;
    EXPECT_EQ(found.front().shared_m > 300.0, rooms == 14) << found.front().shared_m;
    EXPECT_GT(found.front().repeated_m, 0.7 * found.front().shared_m) << rooms;
  }
}

WallAgreement agreement_of(double distinctive_m, double contradicted_m, double unclear_m) {
  WallAgreement result = walls(140.0, contradicted_m);
  result.distinctive_m = result.unique_m = distinctive_m;
  result.unclear_m = unclear_m;
  result.overlap = 0.9;
  result.observability = 0.5;
  return result;
}

TEST(WeighedWalls, count_no_more_than_faces_along_each_direction) {
  WallAgreement corridor = agreement_of(35.0, 0.0, 0.0);
  EXPECT_EQ(weighed(corridor).unique_m, 35.0);
  corridor.observability = 0.1;
  EXPECT_DOUBLE_EQ(weighed(corridor).unique_m, 14.0) << "ends of walls that slide along themselves do not count";
  corridor.overlap = 0.25;
  EXPECT_DOUBLE_EQ(weighed(corridor).unique_m, 21.0) << "where maps lie beside each other, chance counts already";
}

TEST(WeighedWalls, count_what_repeats_only_where_a_prior_says_which_place_it_is) {
  WallAgreement hotel = agreement_of(35.0, 0.0, 0.0);
  hotel.unique_m = 3.0;
  hotel.observability = 0.1;
  EXPECT_DOUBLE_EQ(weighed(hotel).unique_m, 3.0);
  EXPECT_LT(log_odds_of(hotel), 0.0);
  hotel.is_placed = true;
  EXPECT_EQ(weighed(hotel).unique_m, 35.0);
}

// Figures of simulated hotels whose robots were in different rooms.
TEST(FitsByChance, where_another_place_would_be_merged_too) {
  EXPECT_TRUE(fits_by_chance(agreement_of(35.0, 1.3, 5.1), agreement_of(15.4, 0.3, 0.7), 4.8, 2.9));
  EXPECT_TRUE(fits_by_chance(agreement_of(300.0, 0.0, 0.0), agreement_of(10.0, 0.0, 0.0), 5.0, 2.9));
}

TEST(FitsByChance, where_what_decides_is_no_more_than_fits_at_a_place_that_cannot_be_right) {
  EXPECT_TRUE(fits_by_chance(agreement_of(35.5, 2.9, 4.1), agreement_of(14.1, 3.7, 3.4), -12.5, 2.9));
  EXPECT_FALSE(fits_by_chance(agreement_of(70.0, 2.9, 4.1), agreement_of(14.1, 3.7, 3.4), -12.5, 2.9));
}

TEST(FitsByChance, leaves_what_fits_much_better_than_any_other_place) {
  EXPECT_FALSE(fits_by_chance(agreement_of(269.0, 0.1, 1.0), agreement_of(60.0, 9.0, 9.0), -20.0, 2.9));
  EXPECT_FALSE(fits_by_chance(agreement_of(14.0, 0.5, 0.5), agreement_of(0.0, 9.0, 9.0), -20.0, 2.9));
}

}  // namespace
}  // namespace mapweave::fusion
