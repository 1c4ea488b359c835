#include "plan_parts.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

constexpr double kLeastDepth = 2.4;   // of a room, metres
constexpr double kBeforeDoor = 1.1;   // stays free before a door
constexpr double kDoorMargin = 0.15;  // of wall on either side of a door

class Apartment {
 public:
  Apartment(const ApartmentOptions& options, std::uint64_t seed)
      : options_(options), numbers_(RandomStream(seed, "apartment").at(0)) {}

  FloorPlan build() {
    const double width = options_.width_m, height = options_.height_m, corridor = options_.corridor_width_m;
    for (const Side& side : sides_seen_from_inside({0.0, 0.0, width, height}))
      add_line(plan_, side.from, side.at(side.length_m, 0.0));
    if (height < 2.0 * kLeastDepth + corridor) {  // one row behind one corridor
      add_row(0.0, width, corridor, height, corridor);
      return std::move(plan_);
    }
    int bands = std::max(1, static_cast<int>(std::lround(height / (2.4 * options_.room_width_m + corridor))));
    while (bands > 1 && 0.5 * (height / bands - corridor) < kLeastDepth) --bands;
    if (width - 2.0 * corridor < options_.room_width_m) bands = 1;
    // Bands of two rows with a corridor between them; where there are several, corridors along both sides join them.
    const double low_x = bands > 1 ? corridor : 0.0, high_x = bands > 1 ? width - corridor : width;
    for (int band = 0; band < bands; ++band) {
      const double low = height * band / bands, high = height * (band + 1) / bands, middle = 0.5 * (low + high);
      const std::size_t first = plan_.rooms.size();
      add_row(low_x, high_x, low, middle - 0.5 * corridor, middle - 0.5 * corridor);
      add_row(low_x, high_x, middle + 0.5 * corridor, high, middle + 0.5 * corridor);
      std::stable_sort(plan_.rooms.begin() + static_cast<std::ptrdiff_t>(first), plan_.rooms.end(),
                       [&](const Room& a, const Room& b) {
                         return band % 2 == 0 ? a.inside.low_x < b.inside.low_x : a.inside.low_x > b.inside.low_x;
                       });
      if (bands > 1) {
        for (const double x : {low_x, high_x}) {
          add_wall(plan_, {x, low}, {x, middle - 0.5 * corridor}, options_.wall_thickness_m);
          add_wall(plan_, {x, middle + 0.5 * corridor}, {x, high}, options_.wall_thickness_m);
        }
        if (band > 0) add_wall(plan_, {low_x, low}, {high_x, low}, options_.wall_thickness_m);
      }
    }
    for (std::size_t i = 0; i < plan_.rooms.size(); ++i) plan_.rooms[i].name = "room " + std::to_string(i);
    return std::move(plan_);
  }

 private:
  // Rooms side by side between two heights, with doors in the wall at corridor_y, which is one of the two.
  void add_row(double low_x, double high_x, double low_y, double high_y, double corridor_y) {
    const double half = 0.5 * options_.wall_thickness_m, door = options_.door_width_m;
    const int count = std::max(1, static_cast<int>((high_x - low_x) / options_.room_width_m));
    const double even = (high_x - low_x) / count;
    if (0.7 * even < door + 2.0 * (half + kDoorMargin)) {
      throw Error(ErrorCode::kBadInput, "rooms are narrower than their doors", "apartment",
                  "make room_width_m greater or door_width_m smaller");
    }
    std::vector<double> cuts{low_x};
    for (int i = 1; i < count; ++i) cuts.push_back(low_x + even * (i + numbers_.uniform(-0.15, 0.15)));
    cuts.push_back(high_x);

    std::vector<Interval> doors, passages;  // passages[i]: in the wall at cuts[i + 1], or empty
    for (int i = 0; i < count; ++i) {
      const std::size_t at = static_cast<std::size_t>(i);
      const double from = numbers_.uniform(cuts[at] + half + kDoorMargin, cuts[at + 1] - half - kDoorMargin - door);
      doors.push_back({from - low_x, from - low_x + door});
      const bool is_open = i + 1 < count && numbers_.chance(options_.connecting_doors) && high_y - low_y > door + 1.0;
      const double height = numbers_.uniform(0.5, high_y - low_y - 0.5 - door);
      passages.push_back(is_open ? Interval{height, height + door} : Interval{});
    }
    add_wall(plan_, {low_x, corridor_y}, {high_x, corridor_y}, options_.wall_thickness_m, doors);
    for (std::size_t i = 1; i + 1 < cuts.size(); ++i) {
      const Interval passage = passages[i - 1];
      add_wall(plan_, {cuts[i], low_y}, {cuts[i], high_y}, options_.wall_thickness_m,
               passage.to > 0.0 ? std::vector<Interval>{passage} : std::vector<Interval>{});
    }
    for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
      const Box inside{cuts[i] + half, low_y + half, cuts[i + 1] - half, high_y - half};
      const bool is_above = corridor_y == low_y;
      const double near = is_above ? inside.low_y : inside.high_y - kBeforeDoor;
      std::vector<Box> keep_free{{low_x + doors[i].from - 0.1, near, low_x + doors[i].to + 0.1, near + kBeforeDoor}};
      for (const std::size_t wall : {i, i + 1}) {
        if (wall == 0 || passages[wall - 1].to == 0.0) continue;
        const Interval passage = passages[wall - 1];
        keep_free.push_back(
            {cuts[wall] - kBeforeDoor, low_y + passage.from - 0.1, cuts[wall] + kBeforeDoor, low_y + passage.to + 0.1});
      }
      add_furniture(plan_, inside, keep_free, options_.furniture, numbers_);
      plan_.rooms.push_back({"room " + std::to_string(plan_.rooms.size()), inside});
    }
  }

  ApartmentOptions options_;
  RandomNumbers numbers_;
  FloorPlan plan_;
};

}  // namespace

FloorPlan make_apartment_plan(const ApartmentOptions& options, std::uint64_t seed) {
  return Apartment(options, seed).build();
}

}  // namespace mapweave::simulation
