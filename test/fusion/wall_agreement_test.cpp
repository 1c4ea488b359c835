#include "placed.h"

#include <gtest/gtest.h>
#include <laser/team_audit.h>

#include <map>

namespace mapweave::fusion {
namespace {

class WallAgreementOfTwoRobots : public testing::Test {
 protected:
  explicit WallAgreementOfTwoRobots(simulation::SimulatedTeam team = make_team())
      : team_(std::move(team)), one_(team_.robots[0], team_.laser), other_(team_.robots[1], team_.laser) {
    std::size_t number = 0;
    for (const Placed* placed : {&one_, &other_})
      for (const auto& model : placed->models()) sights_[number++] = std::make_shared<const WallSight>(*model);
    sight_of_ = [this](std::size_t which) { return sights_.at(which); };
  }
  static simulation::SimulatedTeam make_team() {
    simulation::TeamOptions options;
    options.robots = 2;
    options.shared = 0.7;
    return simulation::make_apartment({}, options);
  }
  Pose2 one_from_other() const {
    return between(team_.robots[0].steps.front().world_from_robot, team_.robots[1].steps.front().world_from_robot);
  }
  std::vector<PlacedSubmap> other_at(const Pose2& pose) const { return other_.at(pose, one_.models().size()); }

  simulation::SimulatedTeam team_;
  Placed one_, other_;
  std::map<std::size_t, std::shared_ptr<const WallSight>> sights_;
  SightOf sight_of_;
};

TEST_F(WallAgreementOfTwoRobots, is_the_same_from_either_side) {
  const auto a = one_.at({}, 0), b = other_at(one_from_other());
  const WallAgreement one = wall_agreement(a, 200.0, b, 200.0, sight_of_),
                      other = wall_agreement(b, 200.0, a, 200.0, sight_of_);
  EXPECT_GT(one.coinciding_m, 20.0);
  EXPECT_NEAR(one.coinciding_m, other.coinciding_m, 1e-6);
  EXPECT_NEAR(one.contradicted_m, other.contradicted_m, 1e-6);
  EXPECT_NEAR(one.distinctive_m, other.distinctive_m, 1e-6);
  EXPECT_NEAR(one.overlap, other.overlap, 1e-9);
  EXPECT_NEAR(one.unique_m, other.unique_m, 1e-6);
  EXPECT_FALSE(one.repeats) << "rooms of an apartment differ";
  EXPECT_GT(one.unique_m, 20.0);
}

TEST_F(WallAgreementOfTwoRobots, falls_and_is_contradicted_where_one_lies_a_metre_aside) {
  const auto a = one_.at({}, 0);
  const WallAgreement right = wall_agreement(a, 200.0, other_at(one_from_other()), 200.0, sight_of_);
  const Pose2 aside = compose(one_from_other(), Pose2{0.7, 0.7, 0.0});
  const WallAgreement wrong = wall_agreement(a, 200.0, other_at(aside), 200.0, sight_of_);
  EXPECT_GT(right.share(), 0.9);
  EXPECT_LT(right.conflict(), 0.02);
  EXPECT_LT(wrong.share(), 0.5 * right.share());
  EXPECT_GT(wrong.contradicted_m, 5.0);
  ASSERT_FALSE(wrong.contradictions.empty());
  EXPECT_GT(wrong.contradictions.front().length_m, 0.6);
}

TEST_F(WallAgreementOfTwoRobots, leaves_the_audit_of_a_right_team_without_ghosts_and_finds_those_of_a_wrong_one) {
  const auto right = audit({one_.at({}, 0), other_at(one_from_other())}, {200.0, 100.0}, sight_of_,
                           [](std::size_t, std::size_t) { return true; });
  ASSERT_EQ(right.pairs.size(), 1U);
  EXPECT_GT(right.pairs[0].coinciding_m, 20.0);
  EXPECT_EQ(right.pairs[0].ghosts_m, 0.0);
  EXPECT_FALSE(right.taken_out.has_value());
  const auto wrong = audit({one_.at({}, 0), other_at(compose(one_from_other(), Pose2{0.7, 0.7, 0.0}))}, {200.0, 100.0},
                           sight_of_, [](std::size_t, std::size_t) { return true; });
  ASSERT_EQ(wrong.pairs.size(), 1U);
  EXPECT_GT(wrong.pairs[0].ghosts_m, 4.0);
  EXPECT_EQ(wrong.taken_out, std::size_t{1}) << "of two that contradict each other the one with fewer walls goes";
}

TEST_F(WallAgreementOfTwoRobots, says_how_a_map_that_lies_aside_would_lie_better) {
  const auto any = [](std::size_t, std::size_t) { return true; };
  EXPECT_TRUE(
      bent_regions({one_.at({}, 0), other_at(one_from_other())}, sight_of_, any, PlaceSizes::all).regions.empty());
  const Pose2 aside{0.6, -0.5, 0.07};
  const BentRegions right = bent_regions({one_.at({}, 0), other_at(one_from_other())}, sight_of_, any, PlaceSizes::all);
  const BentRegions all =
      bent_regions({one_.at(aside, 0), other_at(one_from_other())}, sight_of_, any, PlaceSizes::all);
  EXPECT_GT(all.in_doubt_m, right.in_doubt_m + 10.0);
  const std::vector<BentRegion>& bent = all.regions;
  ASSERT_FALSE(bent.empty());
  double nearest_m = 1e9, nearest_rad = 1e9;
  std::size_t near = 0;
  for (const BentRegion& region : bent) {
    const Pose2 left = compose(compose(region.moved, aside), Pose2{region.x_m, region.y_m, 0.0});
    const double left_m = std::hypot(left.x - region.x_m, left.y - region.y_m);
    near += left_m < 0.3;
    nearest_m = std::min(nearest_m, left_m);
    nearest_rad = std::min(nearest_rad, std::abs(left.phi));
  }
  EXPECT_GE(2 * near, bent.size()) << "where there are few walls, the place is rough";
  EXPECT_LT(nearest_m, 0.15);
  EXPECT_LT(nearest_rad, 0.02);
  EXPECT_TRUE(bent_regions(
                  {one_.at(aside, 0), other_at(one_from_other())}, sight_of_,
                  [](std::size_t, std::size_t) { return false; }, PlaceSizes::all)
                  .regions.empty());
}

class WallAgreementInALongFlat : public WallAgreementOfTwoRobots {
 protected:
  WallAgreementInALongFlat() : WallAgreementOfTwoRobots(make_long_flat()) {}
  static simulation::SimulatedTeam make_long_flat() {
    simulation::ApartmentOptions flat;
    flat.width_m = 50.0;
    flat.height_m = 12.0;
    simulation::TeamOptions options;
    options.robots = 2;
    options.shared = 1.0;
    return simulation::make_apartment(flat, options);
  }
};

// A few metres of one map, in the middle of regions that lie where they should.
TEST_F(WallAgreementInALongFlat, finds_what_lies_aside_in_a_small_part_and_where_it_would_lie_better) {
  const auto any = [](std::size_t, std::size_t) { return true; };
  const Pose2 world_from_one = team_.robots[0].steps.front().world_from_robot, aside{0.9, -0.9, 0.0};
  std::vector<PlacedSubmap> one;
  for (PlacedSubmap submap : one_.at({}, 0)) {
    const double world_x_m = compose(world_from_one, Pose2{submap.x_m, submap.y_m, 0.0}).x;
    if (std::abs(world_x_m - 25.0) < 3.0) {
      submap.team_from_submap = compose(aside, submap.team_from_submap);
      submap.x_m += aside.x;
      submap.y_m += aside.y;
    } else if (std::abs(world_x_m - 25.0) < 8.0) {
      continue;  // what shows the same walls where they should be
    }
    one.push_back(submap);
  }
  const auto other = other_at(one_from_other());
  std::size_t in_small = 0, near = 0;
  for (const BentRegion& region : bent_regions({one, other}, sight_of_, any, PlaceSizes::all).regions) {
    const Pose2 left = compose(compose(region.moved, aside), Pose2{region.x_m, region.y_m, 0.0});
    near += std::hypot(left.x - region.x_m, left.y - region.y_m) < 0.3;
  }
  EXPECT_GT(near, 0U);
  for (const RegionAgreement& region : compare_by_region({one, other}, sight_of_)) {
    const RegionAgreement::Square& small = region.most_doubted;
    EXPECT_LE(in_doubt_m(small), in_doubt_m(region) + 1e-6);
    in_small += small.contradicted_m > 12.0;
  }
  EXPECT_GT(in_small, 0U);
}

class WallAgreementInACorridor : public WallAgreementOfTwoRobots {
 protected:
  WallAgreementInACorridor() : WallAgreementOfTwoRobots(make_corridor_team()) {}
  static simulation::SimulatedTeam make_corridor_team() {
    simulation::CorridorOptions corridor;
    corridor.length_m = 60.0;
    corridor.width_m = 2.0;
    simulation::TeamOptions options;
    options.robots = 2;
    options.shared = 0.8;
    return simulation::make_corridor(corridor, options);
  }
};

TEST_F(WallAgreementInACorridor, that_lies_aside_would_lie_better_across_it_not_along_it_from_either_side) {
  const auto any = [](std::size_t, std::size_t) { return true; };
  const Pose2 world_from_one = team_.robots[0].steps.front().world_from_robot;
  // The corridor runs along x of the world.
  const double across_x = -std::sin(world_from_one.phi), across_y = std::cos(world_from_one.phi);
  const auto aside = one_.at({-0.5 * across_x, -0.5 * across_y, 0.0}, 0);
  const auto other = other_at(one_from_other());
  using Maps = std::vector<std::vector<PlacedSubmap>>;
  for (const bool turned : {false, true}) {
    const std::vector<BentRegion> bent =
        bent_regions(turned ? Maps{other, aside} : Maps{aside, other}, sight_of_, any, PlaceSizes::regions).regions;
    ASSERT_FALSE(bent.empty());
    for (const BentRegion& region : bent) {
      const Pose2 moved = compose(region.moved, Pose2{region.x_m, region.y_m, 0.0});
      const double x = moved.x - region.x_m, y = moved.y - region.y_m, sign = turned ? -1.0 : 1.0;
      EXPECT_NEAR(sign * (x * across_x + y * across_y), 0.5, 0.2);
      EXPECT_NEAR(x * across_y - y * across_x, 0.0, 0.5);
    }
  }
}

class WallAgreementOfRoomsThatAreAlike : public WallAgreementOfTwoRobots {
 protected:
  WallAgreementOfRoomsThatAreAlike() : WallAgreementOfTwoRobots(make_hotel_team()) {}
  static simulation::SimulatedTeam make_hotel_team() {
    simulation::RoomRowOptions hotel;
    hotel.rooms = kRooms;
    hotel.furniture = 2;
    simulation::TeamOptions options;
    options.robots = 2;
    options.shared = 0.0;
    return simulation::make_repeated_rooms(hotel, options);
  }
  static constexpr int kRooms = 8;
};

// Each robot was in rooms of its own; those of one are laid on those of the other.
TEST_F(WallAgreementOfRoomsThatAreAlike, are_found_to_repeat_from_either_side) {
  Pose2 wrong = team_.robots[1].steps.front().world_from_robot;
  wrong.x -= 0.5 * kRooms * simulation::RoomRowOptions{}.room_width_m;
  const auto a = one_.at({}, 0), b = other_at(between(team_.robots[0].steps.front().world_from_robot, wrong));
  const WallAgreement one = wall_agreement(a, 200.0, b, 200.0, sight_of_);
  EXPECT_GT(one.share(), 0.9);
  EXPECT_TRUE(one.repeats);
  EXPECT_LT(one.unique_m, 0.05 * one.coinciding_m);
  const WallAgreement other = wall_agreement(b, 200.0, a, 200.0, sight_of_);
  EXPECT_TRUE(other.repeats);
  EXPECT_NEAR(one.unique_m, other.unique_m, 1e-6);
}

TEST(TeamAudit, takes_furniture_that_moved_for_no_ghost) {
  RegionAgreement region;
  region.coinciding_m = 60.0;
  region.contradicted_m = 3.0;
  region.unclear_m = 4.0;
  EXPECT_FALSE(is_ghost(region));
  region.coinciding_m = 6.0;
  region.contradicted_m = 10.0;
  EXPECT_TRUE(is_ghost(region));
  region.coinciding_m = 20.0;
  region.contradicted_m = 6.0;
  EXPECT_TRUE(is_ghost(region));
  EXPECT_FALSE(is_ghost(region, kGhostBeforeSolution)) << "scans are matched again, which may mend it";
}

// Regions lie where the team's frame has its origin; what is in doubt lies where the maps disagree.
TEST_F(WallAgreementOfTwoRobots, holds_what_is_in_doubt_against_the_walls_around_it_wherever_regions_end) {
  const Pose2 aside{0.7, 0.7, 0.0};
  double least_m = 1e300, most_m = 0.0;
  for (const double shift_m : {0.0, 6.0, 12.0, 18.0}) {
    const Pose2 frame{shift_m, 0.5 * shift_m, 0.0};
    const auto regions =
        compare_by_region({one_.at(frame, 0), other_at(compose(frame, compose(one_from_other(), aside)))}, sight_of_);
    RegionAgreement most;
    for (const RegionAgreement& region : regions) {
      const RegionAgreement around = region.in(region.centred);
      EXPECT_LE(std::abs(around.x_m - region.x_m), 0.5 * RegionAgreement::kSide_m + 1.0) << "its middle is in it";
      EXPECT_LE(std::abs(around.y_m - region.y_m), 0.5 * RegionAgreement::kSide_m + 1.0);
      if (in_doubt_m(around) > in_doubt_m(most)) most = around;
    }
    EXPECT_GT(most.coinciding_m, 0.0);
    least_m = std::min(least_m, in_doubt_m(most));
    most_m = std::max(most_m, in_doubt_m(most));
  }
  EXPECT_GT(least_m, 4.0);
  EXPECT_LT(most_m, 1.3 * least_m);
}

TEST_F(WallAgreementOfTwoRobots, rests_on_a_sight_that_says_what_the_model_does) {
  const matching::SubmapModel& model = *one_.models().front();
  const WallSight sight(model);
  std::map<Seen, std::size_t> times;
  for (double y = -6.0; y < 6.0; y += 0.07)
    for (double x = -6.0; x < 6.0; x += 0.07) {
      const int cx = matching::cell_of(x, 10.0), cy = matching::cell_of(y, 10.0);
      bool is_beside_wall = false, is_clear = true;
      for (int j = -2; j <= 2; ++j)
        for (int i = -2; i <= 2; ++i) {
          is_beside_wall = is_beside_wall || model.sight().get(cx + i, cy + j) == matching::Sight::wall;
          is_clear = is_clear && model.sight().get(cx + i, cy + j) == matching::Sight::free;
        }
      Seen expected = is_clear ? Seen::through : is_beside_wall ? Seen::beside_wall : Seen::in_part;
      if (model.sight().get(cx, cy) == matching::Sight::unknown) expected = Seen::not_at_all;
      if (model.field().likelihood().get(matching::cell_of(x, 20.0), matching::cell_of(y, 20.0)) > 60)
        expected = Seen::wall;
      EXPECT_EQ(sight.at(x, y), expected) << x << ' ' << y;
      ++times[expected];
    }
  EXPECT_GT(times[Seen::wall], 50U);
  EXPECT_GT(times[Seen::beside_wall], 50U);
  EXPECT_GT(times[Seen::in_part], 50U);
  EXPECT_GT(times[Seen::through], 500U);
}

TEST(WallAgreement, counts_walls_that_several_submaps_have_once) {
  std::vector<matching::WallPoint> walls;
  for (int i = 0; i < 20; ++i) walls.push_back({0.1F * static_cast<float>(i) + 0.05F, 0.05F, 0.0F, 1.0F});
  PlacedSubmap one, other;
  one.walls = other.walls = &walls;
  EXPECT_NEAR(length_of_walls({one}), 2.0, 1e-9);
  other.team_from_submap = {1.0, 0.0, 0.0};
  EXPECT_NEAR(length_of_walls({one, other}), 3.0, 1e-9);
}

}  // namespace
}  // namespace mapweave::fusion
