#pragma once
// Occupancy grids drawn straight from floor plans, as other makers would: any resolution, scale, place; bent; parts of
// a building alone.

#include <mapweave/maps/occupancy_grid.h>
#include <mapweave/simulation/floor_plan.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

namespace mapweave::test {

struct DrawnGridOptions {
  double resolution_m = 0.05;
  double scale = 1.0;                          // metres of the grid per metre of the building
  Pose2 grid_from_plan;                        // after scaling
  double bend_m = 0.0;                         // amplitude of a wave across the building
  double bend_length_m = 25.0;                 // and its length
  simulation::Box seen{-1e9, -1e9, 1e9, 1e9};  // of the plan
};

inline simulation::Point2 in_grid(const DrawnGridOptions& options, simulation::Point2 in_plan) {
  const double wave = 2.0 * M_PI / options.bend_length_m;
  const double x = options.scale * (in_plan.x + options.bend_m * std::sin(wave * in_plan.y)),
               y = options.scale * (in_plan.y + options.bend_m * std::sin(wave * in_plan.x));
  const double c = std::cos(options.grid_from_plan.phi), s = std::sin(options.grid_from_plan.phi);
  return {options.grid_from_plan.x + c * x - s * y, options.grid_from_plan.y + s * x + c * y};
}

// What can be reached within the part that is seen is free.
inline OccupancyGrid drawn_grid(const simulation::FloorPlan& plan, const DrawnGridOptions& options = {}) {
  const simulation::Box all = simulation::bounds(plan);
  const simulation::Box seen{std::max(all.low_x, options.seen.low_x), std::max(all.low_y, options.seen.low_y),
                             std::min(all.high_x, options.seen.high_x), std::min(all.high_y, options.seen.high_y)};
  const double step = 0.4 * options.resolution_m / options.scale;
  double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
  const auto each = [&](const simulation::Box& box, const auto& visit) {
    for (double y = box.low_y; y <= box.high_y; y += step)
      for (double x = box.low_x; x <= box.high_x; x += step) visit(in_grid(options, {x, y}));
  };
  each(seen, [&](simulation::Point2 p) {
    x0 = std::min(x0, p.x);
    y0 = std::min(y0, p.y);
    x1 = std::max(x1, p.x);
    y1 = std::max(y1, p.y);
  });
  OccupancyGrid grid;
  grid.resolution_m = options.resolution_m;
  grid.origin_x_m = x0 - 1.0;
  grid.origin_y_m = y0 - 1.0;
  grid.columns = static_cast<int>((x1 - x0 + 2.0) / grid.resolution_m);
  grid.rows = static_cast<int>((y1 - y0 + 2.0) / grid.resolution_m);
  grid.log_odds.assign(static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows),
                       OccupancyGrid::kUnknown);
  const auto set = [&](simulation::Point2 p, std::int16_t value) {
    const int column = static_cast<int>((p.x - grid.origin_x_m) / grid.resolution_m);
    const int row = static_cast<int>((p.y - grid.origin_y_m) / grid.resolution_m);
    if (!grid.inside(column, row)) return;
    grid.log_odds[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.columns) +
                  static_cast<std::size_t>(column)] = value;
  };
  constexpr std::int16_t kReachable = 1;  // seen, but perhaps behind walls
  each(seen, [&](simulation::Point2 p) { set(p, kReachable); });
  for (const auto& wall : plan.walls) {
    const double length = std::hypot(wall.to.x - wall.from.x, wall.to.y - wall.from.y);
    for (double at = 0.0; at <= length; at += step) {
      const double share = at / std::max(length, 1e-9);
      const simulation::Point2 p{wall.from.x + (wall.to.x - wall.from.x) * share,
                                 wall.from.y + (wall.to.y - wall.from.y) * share};
      if (seen.contains(p)) set(in_grid(options, p), 300);
    }
  }
  // Free is what can be reached from the middles of rooms.
  std::vector<std::pair<int, int>> open;
  const auto reach = [&](int column, int row) {
    if (!grid.inside(column, row) || grid.at(column, row) != kReachable) return;
    grid.log_odds[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.columns) +
                  static_cast<std::size_t>(column)] = -300;
    open.emplace_back(column, row);
  };
  for (const auto& room : plan.rooms) {
    const simulation::Point2 p = in_grid(options, room.inside.centre());
    reach(static_cast<int>((p.x - grid.origin_x_m) / grid.resolution_m),
          static_cast<int>((p.y - grid.origin_y_m) / grid.resolution_m));
  }
  while (!open.empty()) {
    const auto [column, row] = open.back();
    open.pop_back();
    for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) reach(column + dx, row + dy);
  }
  std::replace(grid.log_odds.begin(), grid.log_odds.end(), kReachable, OccupancyGrid::kUnknown);
  return grid;
}

// The mirror image.
inline OccupancyGrid flipped(const OccupancyGrid& grid) {
  OccupancyGrid image = grid;
  for (int row = 0; row < grid.rows; ++row)
    std::copy_n(grid.log_odds.begin() + static_cast<std::ptrdiff_t>(row) * grid.columns, grid.columns,
                image.log_odds.begin() + static_cast<std::ptrdiff_t>(grid.rows - 1 - row) * grid.columns);
  return image;
}

// What is no map at all.

inline OccupancyGrid blank_grid(int columns, int rows, std::int16_t value) {
  OccupancyGrid grid;
  grid.columns = columns;
  grid.rows = rows;
  grid.log_odds.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), value);
  return grid;
}

// Lines of letters of 5 x 7 dots.
inline OccupancyGrid page_of_text(unsigned seed) {
  OccupancyGrid grid = blank_grid(500, 400, -300);
  std::mt19937 random(seed);
  std::vector<std::array<unsigned, 7>> letters(26);
  for (auto& letter : letters)
    for (auto& dots : letter) dots = random() % 32;
  for (int y = 20; y + 24 < 400; y += 30)
    for (int x = 20; x + 20 < 500; x += 20) {
      const auto& letter = letters[random() % 26];
      for (int v = 0; v < 21; ++v)
        for (int u = 0; u < 15; ++u)
          if (letter[static_cast<std::size_t>(v / 3)] >> (u / 3) & 1U)
            grid.log_odds[static_cast<std::size_t>((y + v) * 500 + x + u)] = 300;
    }
  return grid;
}

// Smooth noise, as thresholds leave it of a picture.
inline OccupancyGrid photograph(unsigned seed) {
  OccupancyGrid grid = blank_grid(500, 400, 0);
  std::mt19937 random(seed);
  std::vector<std::array<double, 4>> waves(40);
  for (auto& wave : waves)
    wave = {(random() % 1000 - 500.0) / 8000.0, (random() % 1000 - 500.0) / 8000.0, random() % 628 / 100.0,
            1.0 + random() % 100 / 50.0};
  for (int y = 0; y < 400; ++y)
    for (int x = 0; x < 500; ++x) {
      double shade = 0.0;
      for (const auto& wave : waves) shade += wave[3] * std::sin(wave[0] * x + wave[1] * y + wave[2]);
      grid.log_odds[static_cast<std::size_t>(y * 500 + x)] = shade > 5.0 ? 300 : shade < 0.0 ? -300 : 0;
    }
  return grid;
}

}  // namespace mapweave::test
