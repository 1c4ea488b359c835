#include "region_comparison.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::WallPoint;

// Walls of one side in the team's frame, one a cell and direction: of those submaps and places that are wanted.
template <class WantsSubmap, class WantsPlace>
std::vector<WallPoint> walls_of(const std::vector<PlacedSubmap>& side, WantsSubmap&& wants_submap,
                                WantsPlace&& wants_place) {
  std::vector<std::pair<std::uint64_t, WallPoint>> keyed;
  for (const PlacedSubmap& submap : side) {
    if (!wants_submap(submap)) continue;
    const double c = std::cos(submap.team_from_submap.phi), s = std::sin(submap.team_from_submap.phi);
    for (const WallPoint& wall : *submap.walls) {
      const WallPoint there{static_cast<float>(c * wall.x - s * wall.y + submap.team_from_submap.x),
                            static_cast<float>(s * wall.x + c * wall.y + submap.team_from_submap.y),
                            static_cast<float>(c * wall.normal_x - s * wall.normal_y),
                            static_cast<float>(s * wall.normal_x + c * wall.normal_y)};
      if (!wants_place(there)) continue;
      const auto quadrant = static_cast<std::uint64_t>((there.normal_x > there.normal_y ? 1 : 0) +
                                                       (there.normal_x > -there.normal_y ? 2 : 0));
      const auto x = static_cast<std::uint64_t>(cell_of(there.x, 1.0 / kWallCell_m) + (1 << 28)),
                 y = static_cast<std::uint64_t>(cell_of(there.y, 1.0 / kWallCell_m) + (1 << 28));
      keyed.emplace_back((y << 34U) | (x << 3U) | quadrant, there);
    }
  }
  std::stable_sort(keyed.begin(), keyed.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  std::vector<WallPoint> walls;
  for (std::size_t i = 0; i < keyed.size(); ++i)
    if (i == 0 || keyed[i].first != keyed[i - 1].first) walls.push_back(keyed[i].second);
  return walls;
}

std::vector<WallPoint> walls_of(const std::vector<PlacedSubmap>& side, const Region& region) {
  return walls_of(
      side, [&](const PlacedSubmap& submap) { return region.is_reached_by(submap); },
      [&](const WallPoint& wall) { return region.has(wall.x, wall.y); });
}

std::vector<std::pair<int, int>> regions_of(const std::vector<PlacedSubmap>& side) {
  std::vector<std::pair<int, int>> regions;
  for (const PlacedSubmap& submap : side)
    for (int y = cell_of(submap.y_m - submap.radius_m, 1.0 / Region::kSide_m);
         y <= cell_of(submap.y_m + submap.radius_m, 1.0 / Region::kSide_m); ++y)
      for (int x = cell_of(submap.x_m - submap.radius_m, 1.0 / Region::kSide_m);
           x <= cell_of(submap.x_m + submap.radius_m, 1.0 / Region::kSide_m); ++x)
        regions.emplace_back(y, x);
  std::sort(regions.begin(), regions.end());
  regions.erase(std::unique(regions.begin(), regions.end()), regions.end());
  return regions;
}

}  // namespace

std::vector<WallPoint> walls_of(const std::vector<PlacedSubmap>& side) {
  const auto all = [](const auto&) { return true; };
  return walls_of(side, all, all);
}

RegionComparison::RegionComparison(const std::vector<std::vector<PlacedSubmap>>& sides, const SightOf& sight_of)
    : sides_(sides), sight_of_(sight_of) {
  std::map<std::pair<int, int>, std::vector<std::size_t>> reached;
  for (std::size_t side = 0; side < sides.size(); ++side)
    for (const auto& region : regions_of(sides[side])) reached[region].push_back(side);
  for (const auto& [region, by] : reached) {
    if (by.size() < 2) continue;
    Place place{{region.second * Region::kSide_m, region.first * Region::kSide_m}, {}};
    for (const std::size_t side : by) {
      auto walls = walls_of(sides[side], place.region);
      if (!walls.empty()) place.walls.emplace_back(side, std::move(walls));
    }
    if (place.walls.size() < 2) continue;
    place_of_[region] = places_.size();
    places_.push_back(std::move(place));
  }
}

void RegionComparison::see(std::size_t seer, const Visit& visit) const {
  std::map<std::pair<std::size_t, std::size_t>, std::vector<Seen>> seen;  // by place, and number among its walls
  for (const PlacedSubmap& submap : sides_[seer]) {
    const std::vector<std::size_t> near = places_near(submap);
    if (near.empty()) continue;
    const auto sight = sight_of_(submap.number);
    const IntoSubmap into(submap.team_from_submap);
    for (const std::size_t p : near)
      for (std::size_t k = 0; k < places_[p].walls.size(); ++k) {
        const auto& [owner, walls] = places_[p].walls[k];
        if (owner == seer) continue;
        auto& result = seen[{p, k}];
        result.resize(walls.size(), Seen::not_at_all);
        for (std::size_t i = 0; i < walls.size(); ++i) {
          if (result[i] == Seen::wall) continue;
          const Eigen::Vector2d at = into(walls[i].x, walls[i].y);
          result[i] = std::max(result[i], sight->at(at.x(), at.y()));
        }
      }
  }
  for (const auto& [where, result] : seen)
    visit(where.first, places_[where.first].walls[where.second].first, places_[where.first].walls[where.second].second,
          result);
}

std::vector<std::size_t> RegionComparison::places_near(const PlacedSubmap& submap) const {
  std::vector<std::size_t> result;
  const double reach = submap.radius_m + kFarthestShift_m;
  for (int y = cell_of(submap.y_m - reach, 1.0 / Region::kSide_m);
       y <= cell_of(submap.y_m + reach, 1.0 / Region::kSide_m); ++y)
    for (int x = cell_of(submap.x_m - reach, 1.0 / Region::kSide_m);
         x <= cell_of(submap.x_m + reach, 1.0 / Region::kSide_m); ++x) {
      const auto place = place_of_.find({y, x});
      if (place != place_of_.end() && places_[place->second].region.is_reached_by(submap))
        result.push_back(place->second);
    }
  return result;
}

}  // namespace mapweave::fusion
