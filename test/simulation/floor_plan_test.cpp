#include "every_plan.h"

#include <mapweave/core/error.h>
#include <mapweave/simulation/trajectory.h>

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

namespace mapweave::simulation {
namespace {

bool same_walls(const FloorPlan& a, const FloorPlan& b) {
  if (a.walls.size() != b.walls.size()) return false;
  for (std::size_t i = 0; i < a.walls.size(); ++i) {
    const Wall &one = a.walls[i], &other = b.walls[i];
    if (std::tie(one.from.x, one.from.y, one.to.x, one.to.y) !=
        std::tie(other.from.x, other.from.y, other.to.x, other.to.y))
      return false;
  }
  return true;
}

TEST(FloorPlan, is_the_same_for_the_same_seed_and_another_for_another) {
  const auto once = test::every_plan(5), again = test::every_plan(5), other = test::every_plan(6);
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_TRUE(same_walls(once[i].second, again[i].second)) << once[i].first;
    EXPECT_FALSE(same_walls(once[i].second, other[i].second)) << once[i].first;
  }
}

TEST(FloorPlan, lets_a_robot_reach_the_middle_of_every_room) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    for (const auto& [name, plan] : test::every_plan(seed)) {
      const FreeSpace space(plan, 0.3);
      ASSERT_FALSE(plan.rooms.empty()) << name;
      const auto start = space.nearest_free(plan.rooms.front().inside.centre());
      ASSERT_TRUE(start) << name << " seed " << seed;
      for (const Room& room : plan.rooms) {
        const Point2 middle = room.inside.centre();
        EXPECT_GT(test::distance_to_nearest_wall(plan, middle), 0.4) << name << " " << room.name << " seed " << seed;
        const auto goal = space.nearest_free(middle);
        ASSERT_TRUE(goal) << name << " " << room.name << " seed " << seed;
        if (seed > 1) continue;
        EXPECT_TRUE(space.path(*start, *goal)) << name << " " << room.name << " seed " << seed;
      }
    }
  }
}

TEST(FloorPlan, keeps_to_its_size) {
  ApartmentOptions options;
  options.width_m = 25.0;
  options.height_m = 31.0;
  const Box box = bounds(make_apartment_plan(options, 3));
  EXPECT_NEAR(box.low_x, 0.0, 0.1);
  EXPECT_NEAR(box.low_y, 0.0, 0.1);
  EXPECT_NEAR(box.high_x, 25.0, 0.1);
  EXPECT_NEAR(box.high_y, 31.0, 0.1);
}

// Every wall of room `room`, seen from the corner of its place in the row.
std::vector<std::tuple<long, long, long, long>> room_walls(const FloorPlan& plan, int room, double width,
                                                           bool is_image) {
  std::vector<std::tuple<long, long, long, long>> walls;
  for (const Wall& wall : plan.walls) {
    const double middle = 0.5 * (wall.from.x + wall.to.x);
    if (middle < room * width || middle > (room + 1) * width || std::abs(wall.to.x - wall.from.x) > width + 1e-6)
      continue;
    if (std::min(wall.from.y, wall.to.y) < 1.5) continue;  // the corridor's own
    const auto local = [&](double x) {
      return std::lround(1e6 * (is_image ? (room + 1) * width - x : x - room * width));
    };
    const long a = local(wall.from.x), b = local(wall.to.x), c = std::lround(1e6 * wall.from.y),
               d = std::lround(1e6 * wall.to.y);
    walls.emplace_back(std::min(a, b), std::max(a, b), std::min(c, d), std::max(c, d));
  }
  std::sort(walls.begin(), walls.end());
  return walls;
}

TEST(FloorPlan, repeats_rooms_to_the_last_piece_of_furniture) {
  const RoomRowOptions options;
  const FloorPlan plan = make_repeated_rooms_plan(options, 4);
  const auto first = room_walls(plan, 0, options.room_width_m, false);
  EXPECT_GT(first.size(), 12u);
  for (int room = 1; room < options.rooms; ++room)
    EXPECT_EQ(room_walls(plan, room, options.room_width_m, false), first) << room;
}

TEST(FloorPlan, mirrors_every_second_room) {
  const RoomRowOptions options;
  const FloorPlan plan = make_mirrored_rooms_plan(options, 4);
  const auto first = room_walls(plan, 0, options.room_width_m, false);
  for (int room = 1; room < options.rooms; ++room) {
    EXPECT_EQ(room_walls(plan, room, options.room_width_m, room % 2 == 1), first) << room;
    EXPECT_EQ(room_walls(plan, room, options.room_width_m, room % 2 == 0) == first, false)
        << "a mirror image is another room: " << room;
  }
}

TEST(FloorPlan, says_which_options_contradict_one_another) {
  RingOptions ring;
  ring.width_m = 5.0;
  ring.corridor_width_m = 2.5;
  EXPECT_THROW(make_ring_plan(ring, 1), Error);
  ApartmentOptions apartment;
  apartment.room_width_m = 2.0;
  apartment.door_width_m = 2.0;
  EXPECT_THROW(make_apartment_plan(apartment, 1), Error);
  RoomRowOptions row;
  row.room_width_m = 1.2;
  EXPECT_THROW(make_repeated_rooms_plan(row, 1), Error);
}

}  // namespace
}  // namespace mapweave::simulation
