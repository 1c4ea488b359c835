#include "seen_raster.h"

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {

using matching::cell_of;

void PlaneBox::add(double x, double y, double around_m) {
  x0_m = std::min(x0_m, x - around_m);
  y0_m = std::min(y0_m, y - around_m);
  x1_m = std::max(x1_m, x + around_m);
  y1_m = std::max(y1_m, y + around_m);
}

PlaneBox PlaneBox::within(const PlaneBox& other) const {
  return {std::max(x0_m, other.x0_m), std::max(y0_m, other.y0_m), std::min(x1_m, other.x1_m),
          std::min(y1_m, other.y1_m)};
}

PlaneBox box_of(const std::vector<PlacedSubmap>& side) {
  PlaneBox box;
  for (const PlacedSubmap& submap : side) box.add(submap.x_m, submap.y_m, submap.radius_m);
  return box;
}

std::vector<matching::WallPoint> walls_in(const std::vector<PlacedSubmap>& side, const PlaneBox& box) {
  std::vector<matching::WallPoint> walls;
  matching::Raster<char> taken(
      cell_of(box.x0_m, 1.0 / SeenRaster::kCell_m), cell_of(box.y0_m, 1.0 / SeenRaster::kCell_m),
      cell_of(box.x1_m, 1.0 / SeenRaster::kCell_m), cell_of(box.y1_m, 1.0 / SeenRaster::kCell_m));
  for (const PlacedSubmap& submap : side) {
    const double c = std::cos(submap.team_from_submap.phi), s = std::sin(submap.team_from_submap.phi);
    for (const matching::WallPoint& wall : *submap.walls) {
      const double x = c * wall.x - s * wall.y + submap.team_from_submap.x,
                   y = s * wall.x + c * wall.y + submap.team_from_submap.y;
      if (!box.has(x, y)) continue;
      char& cell = taken.at(cell_of(x, 1.0 / SeenRaster::kCell_m), cell_of(y, 1.0 / SeenRaster::kCell_m));
      if (cell != 0) continue;
      cell = 1;
      walls.push_back({static_cast<float>(x), static_cast<float>(y),
                       static_cast<float>(c * wall.normal_x - s * wall.normal_y),
                       static_cast<float>(s * wall.normal_x + c * wall.normal_y)});
    }
  }
  return walls;
}

SeenRaster::SeenRaster(const std::vector<PlacedSubmap>& side, const PlaneBox& box, const SightOf& sight_of)
    : cells_(cell_of(box.x0_m, 1.0 / kCell_m), cell_of(box.y0_m, 1.0 / kCell_m), cell_of(box.x1_m, 1.0 / kCell_m),
             cell_of(box.y1_m, 1.0 / kCell_m)) {
  constexpr double kBeyondWalls_m = 1.0;  // beside a submap that its raster covers
  for (const PlacedSubmap& submap : side) {
    PlaneBox around;
    around.add(submap.x_m, submap.y_m, submap.radius_m + kBeyondWalls_m);
    around = around.within(box);
    if (around.empty()) continue;
    const auto sight = sight_of(submap.number);
    const Pose2 from_team = inverse(submap.team_from_submap);
    const double c = std::cos(from_team.phi), s = std::sin(from_team.phi);
    for (int j = cell_of(around.y0_m, 1.0 / kCell_m); j <= cell_of(around.y1_m, 1.0 / kCell_m); ++j)
      for (int i = cell_of(around.x0_m, 1.0 / kCell_m); i <= cell_of(around.x1_m, 1.0 / kCell_m); ++i) {
        Seen& seen = cells_.at(i, j);
        if (seen == Seen::wall) continue;
        const double x = (i + 0.5) * kCell_m, y = (j + 0.5) * kCell_m;
        seen = std::max(seen, sight->at(c * x - s * y + from_team.x, s * x + c * y + from_team.y));
      }
  }
}

matching::Raster<char> SeenRaster::walls_about() const {
  const auto half = [](int cell) { return cell_of(cell, 0.5); };
  matching::Raster<char> about(half(cells_.first_x()) - 1, half(cells_.first_y()) - 1,
                               half(cells_.first_x() + cells_.width() - 1) + 1,
                               half(cells_.first_y() + cells_.height() - 1) + 1);
  for (int j = cells_.first_y(); j < cells_.first_y() + cells_.height(); ++j)
    for (int i = cells_.first_x(); i < cells_.first_x() + cells_.width(); ++i)
      if (cells_.at(i, j) == Seen::wall)
        for (int v = -1; v <= 1; ++v)
          for (int u = -1; u <= 1; ++u) about.at(half(i) + u, half(j) + v) = 1;
  return about;
}

OccupancyGrid SeenRaster::grid() const {
  constexpr std::int16_t kSure = 100;  // log odds of any cell that was seen: sure, either way
  OccupancyGrid grid;
  grid.resolution_m = kCell_m;
  grid.origin_x_m = cells_.first_x() * kCell_m;
  grid.origin_y_m = cells_.first_y() * kCell_m;
  grid.columns = cells_.width();
  grid.rows = cells_.height();
  grid.log_odds.reserve(static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows));
  for (int j = cells_.first_y(); j < cells_.first_y() + cells_.height(); ++j)
    for (int i = cells_.first_x(); i < cells_.first_x() + cells_.width(); ++i) {
      const Seen seen = cells_.at(i, j);
      grid.log_odds.push_back(seen == Seen::not_at_all
                                  ? OccupancyGrid::kUnknown
                                  : static_cast<std::int16_t>(seen == Seen::wall ? kSure : -kSure));
    }
  return grid;
}

}  // namespace mapweave::fusion
