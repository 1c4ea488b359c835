#pragma once
// One plan of each kind, of usual size.

#include <mapweave/simulation/floor_plan.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::test {

inline std::vector<std::pair<std::string, simulation::FloorPlan>> every_plan(std::uint64_t seed) {
  using namespace simulation;
  ApartmentOptions large;
  large.width_m = 40.0;
  large.height_m = 35.0;
  ApartmentOptions tiny;
  tiny.width_m = tiny.height_m = 4.0;
  RoomRowOptions cluttered;
  cluttered.clutter = 6;
  return {{"corridor", make_corridor_plan({}, seed)},
          {"apartment", make_apartment_plan({}, seed)},
          {"large apartment", make_apartment_plan(large, seed)},
          {"tiny apartment", make_apartment_plan(tiny, seed)},
          {"repeated rooms", make_repeated_rooms_plan({}, seed)},
          {"mirrored rooms", make_mirrored_rooms_plan(cluttered, seed)},
          {"hall", make_hall_plan({}, seed)},
          {"warehouse", make_warehouse_plan({}, seed)},
          {"ring", make_ring_plan({}, seed)}};
}

// The nearest wall's distance, by looking at all of them.
inline double distance_to_nearest_wall(const simulation::FloorPlan& plan, simulation::Point2 p) {
  double least = 1e9;
  for (const simulation::Wall& wall : plan.walls) least = std::min(least, distance_to_wall(wall, p));
  return least;
}

}  // namespace mapweave::test
